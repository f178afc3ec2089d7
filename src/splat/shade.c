#include "splat/shade.h"

#include "base/mem.h"
#include "base/mutation.h"
#include "base/vec3.h"

/* Lines over steps h miss x^p by up to h^2 p^2 / 8; 250 steps for each unit of power keep that below 2e-6. */
static int power_steps(double power)
{
    int n = 1024;
    while (n < 65536 && n < 250 * power)
        n *= 2;
    return n;
}

CtsStatus cts_shade_init(CtsShade *s, const CtsPreset *preset, const CtsVolume *volume, const CtsView *view,
                         const int axes[3], CtsError *err)
{
    double inverse[3][3];
    CtsStatus st;
    *s = (CtsShade){.ambient = (float)preset->ambient,
                    .diffuse = (float)preset->diffuse,
                    .specular = (float)preset->specular,
                    .n_power = power_steps(preset->power)};
    if (preset->power >= 1 && preset->power <= 128 && preset->power == floor(preset->power)) {
        s->whole_power = (int)preset->power;
        s->least_power = (float)pow(1e-30, 1 / preset->power);
    }
    if (!cts_volume_inverse(volume, inverse))
        return cts_fail(err, CTS_ERR_GEOMETRY, "the volume's steps do not span space (is one spacing zero?)");
    if ((st = cts_alloc_array(&s->power, (size_t)s->n_power + 1, err)))
        return st;
    for (int i = 0; i <= s->n_power; i++)
        s->power[i] = (float)pow((double)i / s->n_power, preset->power);
    for (int i = 0; i < 9 && CTS_MUTATED(GRADIENT_STEPS); i++)
        inverse[i / 3][i % 3] = i % 4 == 0;
    for (int i = 0; i < 3; i++) {
        s->along[i] = (float)view->forward_vox[axes[i]];
        s->form[i] = (float)cts_dot3(inverse[axes[i]], inverse[axes[i]]);
    }
    s->form[3] = (float)(2 * cts_dot3(inverse[axes[0]], inverse[axes[1]]));
    s->form[4] = (float)(2 * cts_dot3(inverse[axes[0]], inverse[axes[2]]));
    s->form[5] = (float)(2 * cts_dot3(inverse[axes[1]], inverse[axes[2]]));
    return CTS_OK;
}

void cts_shade_free(CtsShade *s)
{
    cts_free(&s->power);
}
