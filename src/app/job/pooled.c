#include "app/job/pooled.h"

#include "base/limits.h"
#include <math.h>

void cts_verified_add(CtsVerified *all, const CtsVerified *frame)
{
    const uint64_t n = all->pixels + frame->pixels;
    if (!n)
        return;
    const CtsVerified before = *all;
    const double a = (double)before.pixels / (double)n, b = (double)frame->pixels / (double)n;
    if (frame->max >= all->max)
        *all = *frame;
    all->rmse = sqrt(a * before.rmse * before.rmse + b * frame->rmse * frame->rmse);
    all->p999 = fmax(before.p999, frame->p999);
    all->share_above = a * before.share_above + b * frame->share_above;
    all->unit = fmax(a * before.unit, b * frame->unit);
    for (int k = 0; k < CTS_ERROR_CAPS; k++)
        all->capped[k] = a * before.capped[k] + b * frame->capped[k];
    all->wall_ms = before.wall_ms + frame->wall_ms;
    all->cpu_ms = before.cpu_ms + frame->cpu_ms;
    all->pixels = n;
    cts_error_limits(all);
}
