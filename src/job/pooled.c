#include "job/pooled.h"

#include <math.h>

/* Half the width of the interval in the logarithm, back as a share of the mean square. */
static double spread_of(const CtsVerified *v)
{
    return v->rmse > 0 ? log(v->rmse_high / v->rmse_low) : 0;
}

/* One verdict on all frames: pooled rmse and interval, largest maximum and percentile. */
void cts_verified_add(CtsVerified *all, const CtsVerified *frame)
{
    const uint64_t n = all->pixels + frame->pixels;
    if (!n)
        return;
    const CtsVerified before = *all;
    const double a = (double)before.pixels / (double)n, b = (double)frame->pixels / (double)n;
    const double square[2] = {a * before.rmse * before.rmse, b * frame->rmse * frame->rmse};
    const double mean = square[0] + square[1];
    const double spread = mean > 0 ? hypot(square[0] * spread_of(&before), square[1] * spread_of(frame)) / mean : 0;
    if (frame->max >= all->max)
        *all = *frame;
    all->rmse = sqrt(mean);
    all->rmse_low = all->rmse * exp(-0.5 * spread);
    all->rmse_high = all->rmse * exp(0.5 * spread);
    all->p999 = fmax(before.p999, frame->p999);
    all->share_above = a * before.share_above + b * frame->share_above;
    all->wall_ms = before.wall_ms + frame->wall_ms;
    all->cpu_ms = before.cpu_ms + frame->cpu_ms;
    all->pixels = n;
}
