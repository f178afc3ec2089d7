#include "core/scene/shade.h"

#include "base/mem.h"
#include "base/mutation.h"
#include <math.h>

/* Linear interpolation with step h has an error of up to h^2 p^2 / 8 for x^p; 250 steps for each unit of power keep it
 * below 2e-6. */
static int power_steps(double power)
{
    int n = 1024;
    while (n < 65536 && n < 250 * power)
        n *= 2;
    return n;
}

bool cts_shade_air_beyond(const CtsPreset *preset, const CtsVolume *volume)
{
    const double air = volume->quantity == CTS_QUANTITY_HU ? CTS_LEAST_HU : volume->hu_offset;
    return cts_preset_opacity(preset, air) == 0;
}

int cts_shade_step(const CtsVolume *volume, int axis)
{
    return axis == 2 ? volume->slice_layers : 1;
}

CtsStatus cts_shade_init(CtsShade *s, const CtsPreset *preset, const CtsVolume *volume, const CtsView *view,
                         const int axes[3], CtsError *err)
{
    CtsStatus st;
    *s = (CtsShade){.ambient = (float)preset->ambient,
                    .diffuse = (float)preset->diffuse,
                    .specular = (float)preset->specular,
                    .exponent = (float)preset->power,
                    .occlusion = (float)preset->occlusion,
                    .n_power = power_steps(preset->power),
                    .least_power = 1e-30f,
                    .air_beyond = cts_shade_air_beyond(preset, volume)};
    if (preset->power >= 1 && preset->power <= 128 && preset->power == floor(preset->power)) {
        s->whole_power = (int)preset->power;
        s->least_power = (float)pow(1e-30, 1 / preset->power);
    }
    if ((st = cts_alloc_array(&s->power, (size_t)s->n_power + 1, err)))
        return st;
    for (int i = 0; i <= s->n_power; i++)
        s->power[i] = (float)pow((double)i / s->n_power, preset->power);
    const double *const along[3] = {view->right_vox, view->up_vox, view->forward_vox};
    const double *const stepless[3] = {view->right_lps, view->up_lps, view->forward_lps};
    for (int c = 0; c < 3; c++) {
        s->step[c] = cts_shade_step(volume, axes[c]);
        for (int i = 0; i < 3; i++)
            s->frame[i][c] = (float)((CTS_MUTATED(GRADIENT_STEPS) ? stepless : along)[i][axes[c]] / s->step[c]);
    }
    return CTS_OK;
}

void cts_shade_free(CtsShade *s)
{
    cts_free(&s->power);
}
