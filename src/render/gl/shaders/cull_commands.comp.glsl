// The draw commands of what was seen last (BEGIN), and those of what has come into sight since.
// Others have no instance.
layout(local_size_x = 64) in;

struct Command {
    uint indices, instances, first_index;
    int base_vertex;
    uint base_instance;
};
layout(std430, binding = 2) readonly buffer Commands { Command commands[]; };
layout(std430, binding = 3) buffer Seen { Command seen[]; };
layout(std430, binding = 4) buffer Found { Command found[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= commands.length()) return;
    Command command = commands[i];
    CullRecord record = records[i];
#ifdef BEGIN
    command.instances = last[record.slot] != 0u ? 1u : 0u;
    seen[i] = command;
#else
    bool visible = now[record.slot] != 0u || record.always != 0u || !isTurn(record.slot);
    command.instances = visible && seen[i].instances == 0u ? 1u : 0u;
    found[i] = command;
    last[record.slot] = visible ? 1u : 0u;
#endif
}
