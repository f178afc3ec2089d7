#include "app/job/contrast.h"

#include "base/meter.h"
#include "ctsplat/mixture.h"
#include <string.h>

static CtsStatus find_contrast(const CtsVolume *volume, int n_threads, bool *found, CtsError *err)
{
    uint64_t *count = NULL;
    CtsMixture mixture;
    CtsStatus st = cts_volume_histogram(volume, n_threads, &count, err);
    if (!st && !(st = cts_mixture_fit(count, volume->hu_offset, volume->hu_step, &mixture, err)))
        *found = cts_mixture_has_contrast(&mixture);
    cts_volume_histogram_free(&count);
    return st;
}

CtsStatus cts_contrast_check(const CtsVolume *volume, int n_threads, CtsPreset *preset, CtsReport *report,
                             CtsError *err)
{
    bool found = true;
    if (!preset->needs_contrast)
        return CTS_OK;
    const CtsMeter meter = cts_meter_start(report);
    const CtsStatus st = find_contrast(volume, n_threads, &found, err);
    cts_meter_stop(meter, report, CTS_STAGE_CLASSIFY);
    if (st || found)
        return st;
    const CtsPreset *bone = cts_preset_builtin(0);
    preset->n_colour = bone->n_colour;
    memcpy(preset->colour, bone->colour, sizeof bone->colour);
    cts_report_finding(report, "no_contrast", CTS_WARNING,
                       "preset %s: no contrast agent is to be seen in the blood, so what shows is bone, in the "
                       "colours of bone (take preset %s, or a series with contrast agent)",
                       preset->name, bone->name);
    return CTS_OK;
}
