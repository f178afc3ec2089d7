/* The same for processors that have it; plain C where the compiler lacks the flags. */
#define cts_shape_reach_rows_c cts_shape_reach_rows_avx2
#define cts_shape_find_moves_c cts_shape_find_moves_avx2
#define cts_shape_write_layer_c cts_shape_write_layer_avx2
#include "core/volume/shape_move_c.c"
