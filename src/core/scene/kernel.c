#include "core/scene/kernel.h"

#include "base/enum_table.h"

CTS_ENUM_TABLE(char *const, cts_kernel_names,
               CTS_N_KERNELS, [CTS_KERNEL_TENT] = "tent", [CTS_KERNEL_GAUSSIAN] = "gaussian",
               [CTS_KERNEL_CONE] = "cone", [CTS_KERNEL_BSPLINE] = "bspline", [CTS_KERNEL_CONE_PAPER] = "cone-paper");

static CTS_ENUM_TABLE(double, own_radius, CTS_N_KERNELS, [CTS_KERNEL_TENT] = 1, [CTS_KERNEL_GAUSSIAN] = 2,
                      [CTS_KERNEL_CONE] = 1.5, [CTS_KERNEL_BSPLINE] = 2, [CTS_KERNEL_CONE_PAPER] = 1.5);

double cts_kernel_radius(CtsKernelId kernel, double radius)
{
    return radius > 0 ? radius : own_radius[kernel];
}
