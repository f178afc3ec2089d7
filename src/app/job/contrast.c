#include "app/job/contrast.h"

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

CtsStatus cts_contrast_check(const CtsVolume *volume, int n_threads, CtsPreset *preset, bool *missing, CtsError *err)
{
    bool found = true;
    const CtsStatus st = preset->needs_contrast ? find_contrast(volume, n_threads, &found, err) : CTS_OK;
    *missing = !st && !found;
    if (!*missing)
        return st;
    const CtsPreset *bone = cts_preset_builtin(0);
    preset->n_colour = bone->n_colour;
    memcpy(preset->colour, bone->colour, sizeof bone->colour);
    return CTS_OK;
}

void cts_contrast_tell(const CtsPreset *preset, CtsReport *report)
{
    cts_report_finding(report, "no_contrast", CTS_WARNING,
                       "preset %s: no contrast agent is to be seen in the blood, so what shows is bone, in the "
                       "colours of bone (take preset %s, or a series with contrast agent)",
                       preset->name, cts_preset_builtin(0)->name);
}
