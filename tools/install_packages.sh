#!/usr/bin/env bash
# Installs the Debian 12 packages that are missing, without asking anything.
#
# usage: tools/install_packages.sh [GROUP...]
#   build   to build and test Pietra (the default)
#   ci      for the fuzzers and faster rebuilds
#   demo    the relief of the Earth that ./demo shows
set -euo pipefail

declare -A packages=(
    [build]="g++ cmake ninja-build pkg-config python3 libcli11-dev libegl-dev libegl-mesa0 libegl1
             libepoxy-dev libfmt-dev libgl1-mesa-dri libglm-dev libgtest-dev libhwy-dev
             libimgui-dev liblzma-dev libmeshoptimizer-dev libpng-dev libsdl2-dev libspdlog-dev
             libtbb-dev libxxhash-dev libzstd-dev nlohmann-json3-dev zlib1g-dev"
    [ci]="ccache clang-14 libclang-rt-14-dev"
    [demo]="ferret-datasets"
)

missing=()
for group in "${@:-build}"; do
    [[ -v packages[$group] ]] || { echo "install_packages: unknown group '$group'" >&2; exit 2; }
    for package in ${packages[$group]}; do
        [[ $(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null) == installed ]] ||
            missing+=("$package")
    done
done
[[ ${#missing[@]} -gt 0 ]] || exit 0

if ! command -v apt-get >/dev/null; then
    echo "install_packages: this is no Debian; please install what corresponds to: ${missing[*]}" >&2
    exit 1
fi
as_root=(env DEBIAN_FRONTEND=noninteractive)
if [[ $(id -u) -ne 0 ]]; then
    if ! command -v sudo >/dev/null; then
        echo "install_packages: not root, and there is no sudo; please install: ${missing[*]}" >&2
        exit 1
    fi
    as_root=(sudo "${as_root[@]}")
fi

echo "Installing ${missing[*]}"
apt=("${as_root[@]}" apt-get -q -o DPkg::Lock::Timeout=300)
# A foreign package source that does not answer is no reason to stop: the installation will tell.
"${apt[@]}" update || echo "install_packages: the package lists could not be updated in full" >&2
"${apt[@]}" install -y --no-install-recommends "${missing[@]}"
