#define cts_project_tile cts_project_tile_avx512
#include "engine/project/project_packets.c"
