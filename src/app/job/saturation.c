#include "app/job/saturation.h"

#include <math.h>
#include <string.h>

/* Five grey levels of 255 are as good as none; a two-hundredth of a picture is as good as nothing of it. */
enum { EVERY = 7 }; /* pixels: some tell of all */
static const float black = 5.0f / 255, white = 250.0f / 255;
static const double nearly_all = 0.995;

void cts_saturation_add(CtsSaturation *saturation, const CtsPicture *band)
{
    const size_t n = (size_t)band->width * (size_t)band->height, channels = (size_t)band->n_channels;
    for (size_t i = 0; i < n; i += EVERY) {
        const float *p = &band->pixels[i * channels], *last = p + (channels == 1 ? 0 : 2);
        const float most = fmaxf(fmaxf(p[0], p[channels / 3]), *last);
        const float least = fminf(fminf(p[0], p[channels / 3]), *last);
        saturation->n_black += most <= black;
        saturation->n_white += least >= white;
        saturation->n_seen += p[0] > 0;
        saturation->n_full += p[0] >= 1;
        saturation->n++;
    }
}

static bool is_told(const CtsReport *report, const char *code)
{
    for (size_t i = 0; report && i < report->findings.n; i++)
        if (!strcmp(report->findings.items[i].code, code))
            return true;
    return false;
}

void cts_saturation_tell(const CtsSaturation *s, const CtsPictureInfo *info, CtsReport *report)
{
    const bool projects = info->mode != CTS_MODE_COMPOSITE, is_black = (double)s->n_black > nearly_all * (double)s->n;
    if (projects && 2 * s->n_full > s->n_seen)
        cts_report_finding(report, "mostly_white", CTS_WARNING,
                           "%.0f %% of what the picture shows is white, %g HU and more (move the `window` up, or show "
                           "less at once by a `slab` of some 10 mm)",
                           100.0 * (double)s->n_full / (double)s->n_seen, info->window_high_hu);
    else if ((is_black || (double)s->n_white > nearly_all * (double)s->n) && !is_told(report, "nothing_visible"))
        cts_report_finding(report, is_black ? "nearly_black" : "nearly_white", CTS_WARNING,
                           projects
                               ? "the picture is nearly all %s: little of it lies between %g and %g HU (move the "
                                 "`window`; `mode` without a preset takes one that fits)"
                               : "the picture is nearly all %s (see what HU the preset shows, the `background`, and "
                                 "the scale)",
                           is_black ? "black" : "white", info->window_low_hu, info->window_high_hu);
}
