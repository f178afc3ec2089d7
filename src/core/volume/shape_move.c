/* The kernels of shape-based interpolation, on each SIMD path. */
#include "base/simd_path.h"
#include "core/volume/shape_move_tmpl.h"

void CTS_ON_PATH(cts_shape_find_moves)(const ShapeGap *gap, float part)
{
    find_moves(gap, part);
}

void CTS_ON_PATH(cts_shape_write_layer)(const ShapeGap *gap, const ShapeLayer *layer, ShapeSums *sums)
{
    write_layer(gap, layer, sums);
}
