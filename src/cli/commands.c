#include "cli/commands.h"

#include <limits.h>

const CliCommand cli_commands[CLI_N_COMMANDS] = {
    {"info", "PATH... [options]", "List the series in PATH, or of a PACS, and whether they can be rendered.", 1,
     INT_MAX, "PATH", cli_info},
    {"render", "PATH... -o FILE [-o FILE]... [options]", "Render pictures of a series.", 1, INT_MAX, "PATH",
     cli_render},
    {"batch", "PATH... -O DIR [options]", "Render every series with every preset and view; can be resumed.", 0, INT_MAX,
     "PATH", cli_batch},
    {"serve", "PATH... [options]", "Turn volumes in a browser; answers PS3.18 rendered3D.", 0, INT_MAX, "PATH",
     cli_serve},
    {"presets", "[NAME or FILE] [--json]", "List the presets, or show one.", 0, 1, "NAME", cli_presets},
    {"bench", "PATH... {-O DIR | --paper} [options]", "Measure error against run time of engines and settings.", 1,
     INT_MAX, "PATH", cli_bench},
    {"check", "[options]", "Run the numerical stability suite.", 0, 0, "", cli_check},
    {"compare", "A B [--json]", "Compare pictures (PNG, EXR, captures); exit 0 when equal to the bit, 1 when not.", 2,
     2, "a picture", cli_compare},
};
