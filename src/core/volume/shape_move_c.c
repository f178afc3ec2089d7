/* The kernels of shape-based interpolation in plain C. */
#include "core/volume/shape_move_tmpl.h"

void cts_shape_reach_rows_c(int16_t *distance, const int n_blocks[2])
{
    reach_rows(distance, n_blocks);
}

void cts_shape_find_moves_c(const ShapeGap *gap, float part)
{
    find_moves(gap, part);
}

void cts_shape_write_layer_c(const ShapeGap *gap, const ShapeLayer *layer, ShapeSums *sums)
{
    write_layer(gap, layer, sums);
}
