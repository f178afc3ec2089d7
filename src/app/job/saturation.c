#include "app/job/saturation.h"

void cts_saturation_add(CtsSaturation *saturation, const CtsPicture *band)
{
    if (band->info.mode == CTS_MODE_COMPOSITE)
        return;
    const size_t n = (size_t)band->width * (size_t)band->height, channels = (size_t)band->n_channels;
    for (size_t i = 0; i < n; i++) {
        const float grey = band->pixels[i * channels];
        saturation->n_seen += grey > 0;
        saturation->n_white += grey >= 1;
    }
}

void cts_saturation_tell(const CtsSaturation *saturation, const CtsPictureInfo *info, CtsReport *report)
{
    if (2 * saturation->n_white > saturation->n_seen)
        cts_report_finding(report, "mostly_white", CTS_WARNING,
                           "%.0f %% of what the picture shows is white, %g HU and more (move the `window` up, or show "
                           "less at once by a `slab` of some 10 mm)",
                           100.0 * (double)saturation->n_white / (double)saturation->n_seen, info->window_high_hu);
}
