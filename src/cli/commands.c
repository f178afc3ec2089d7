#include "cli/commands.h"

#include <limits.h>

const CliCommand cli_commands[CLI_N_COMMANDS] = {
    {"info", "PATH... [options]", "List the series in PATH and whether they can be rendered, or the series of a PACS.",
     1, INT_MAX, "PATH", cli_info},
    {"render", "PATH... -o FILE [-o FILE]... [options]", "Render pictures of a series.", 1, INT_MAX, "PATH",
     cli_render},
    {"batch", "PATH... -O DIR [options]", "Render every series with every preset and view; can be stopped and resumed.",
     0, INT_MAX, "PATH", cli_batch},
    {"bench", "PATH... {-O DIR | --paper} [options]",
     "Measure error against run time for each engine and setting on a series.", 1, INT_MAX, "PATH", cli_bench},
    {"check", "[options]", "Run the numerical stability suite.", 0, 0, "", cli_check},
    {"compare", "A B [--json]", "Compare two pictures of the same size; exit 0 when equal to the bit, 1 when not.", 2,
     2, "a picture", cli_compare},
    {"presets", "[NAME or FILE] [--json]", "List the presets, or show one.", 0, 1, "NAME", cli_presets},
    {"receive", "-O DIR [options]", "Receive CT images from scanners and archives (C-STORE) into a folder.", 0, 0, "",
     cli_receive},
    {"serve", "PATH... [options]",
     "Keep volumes loaded, and render pictures of them for a browser or PS3.18 rendered3D.", 0, INT_MAX, "PATH",
     cli_serve},
};
