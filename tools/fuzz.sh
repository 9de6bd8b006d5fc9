#!/usr/bin/env bash
# Builds the fuzz targets and runs all of them, for so many seconds in all; the first fault ends it.
#
# usage: tools/fuzz.sh SECONDS
set -euo pipefail
cd "$(dirname "$0")/.."

echo "== Building (fuzz)"
tools/build.sh fuzz fuzz_targets
mapfile -t targets < <(find build/fuzz -maxdepth 1 -name 'fuzz_*' -type f -executable | sort)
if [[ ${#targets[@]} -eq 0 ]]; then
    echo "fuzz: there are no targets" >&2
    exit 1
fi
each=$(($1 / ${#targets[@]} + 1))
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for target in "${targets[@]}"; do
    name=$(basename "$target")
    seeds=fuzz/corpus/${name#fuzz_}
    mkdir "$work/$name"
    # Models are written anew, as a stored one would be of an older format.
    [[ ! $name =~ ^fuzz_(model|operations)$ ]] || FUZZ_SEEDS=$work/$name "$target"
    echo "== Fuzzing $name for $each s"
    "$target" -max_total_time="$each" -rss_limit_mb=2048 -timeout=10 -print_final_stats=1 \
        -artifact_prefix="$PWD/build/fuzz/$name-" "$work/$name" $([[ -d $seeds ]] && echo "$seeds") \
        2>"$work/log" || { tail -40 "$work/log" >&2; exit 1; }
    grep -E 'stat::(number_of_executed_units|average_exec_per_sec)' "$work/log"
done
echo "${#targets[@]} passed, 0 failed"
