#define cts_project_tile cts_project_tile_avx2
#include "engine/project/project_packets.c"
