/* Meaning of a preset's numbers, and the series that it fits. */
#include "ctsplat/preset.h"

#include "base/enum_table.h"
#include "base/text.h"

CTS_ENUM_TABLE(char *const, cts_scale_names, CTS_N_SCALES, [CTS_SCALE_HU] = "HU", [CTS_SCALE_SUVBW] = "SUVbw",
               [CTS_SCALE_BQML] = "Bq/ml", [CTS_SCALE_STORED] = "stored", [CTS_SCALE_RELATIVE] = "relative");
_Static_assert((int)CTS_SCALE_HU == CTS_QUANTITY_HU && (int)CTS_SCALE_SUVBW == CTS_QUANTITY_SUVBW &&
                   (int)CTS_SCALE_BQML == CTS_QUANTITY_BQML && (int)CTS_SCALE_STORED == CTS_QUANTITY_STORED &&
                   (int)CTS_SCALE_RELATIVE == CTS_N_QUANTITIES,
               "scales are the quantities, then the relative one");

bool cts_preset_fits(const CtsPreset *preset, CtsQuantity quantity)
{
    return preset->scale == CTS_SCALE_RELATIVE ? quantity != CTS_QUANTITY_HU : (int)preset->scale == (int)quantity;
}

static CtsModality shown_as(CtsModality modality, CtsQuantity quantity)
{
    return modality == CTS_MODALITY_CT && quantity != CTS_QUANTITY_HU ? CTS_MODALITY_MR : modality;
}

bool cts_preset_suits(const CtsPreset *preset, CtsModality modality, CtsQuantity quantity)
{
    return cts_preset_fits(preset, quantity) &&
           (preset->modality == CTS_ANY_MODALITY || preset->modality == (int)shown_as(modality, quantity));
}

const char *cts_preset_default(CtsModality modality, CtsQuantity quantity, bool composite)
{
    if (quantity == CTS_QUANTITY_HU)
        return "bone";
    if (shown_as(modality, quantity) == CTS_MODALITY_MR)
        return composite ? "mr" : "mr-mip";
    return quantity == CTS_QUANTITY_SUVBW ? "pet-mip" : "pet-mip-relative";
}

CtsStatus cts_preset_check(const CtsPreset *preset, CtsModality modality, CtsQuantity quantity, CtsError *err)
{
    char list[800] = "";
    if (cts_preset_fits(preset, quantity))
        return CTS_OK;
    for (size_t i = 0; cts_preset_builtin(i); i++)
        if (cts_preset_suits(cts_preset_builtin(i), modality, quantity))
            cts_text_append(list, sizeof list, " ", "%s", cts_preset_builtin(i)->name);
    return cts_fail(err, CTS_ERR_PRESET, "preset %s: is of scale %s, and the series, %s, of %s (presets that fit: %s)",
                    preset->name, cts_scale_names[preset->scale], cts_modality_names[modality],
                    cts_quantity_names[quantity], list);
}

CtsStatus cts_preset_resolve(CtsPreset *p, const CtsVolume *volume, CtsError *err)
{
    const double air = volume->air_value, range = volume->bright_value - air;
    const CtsStatus st = cts_preset_check(p, volume->modality, volume->quantity, err);
    if (st || p->scale != CTS_SCALE_RELATIVE)
        return st;
    if (!(range > 0))
        return cts_fail(err, CTS_ERR_PIXELS,
                        "preset %s: its scale is relative, and the volume's values are all equal (choose a preset of "
                        "scale %s)",
                        p->name, cts_quantity_names[volume->quantity]);
    for (int i = 0; i < p->n_opacity; i++)
        p->opacity[i].hu = air + range * p->opacity[i].hu;
    for (int i = 0; i < p->n_colour; i++)
        p->colour[i].hu = air + range * p->colour[i].hu;
    if (!p->window_absolute) {
        p->window_low_hu = air + range * p->window_low_hu;
        p->window_high_hu = air + range * p->window_high_hu;
    }
    p->window_absolute = false;
    p->scale = (CtsScale)volume->quantity;
    return CTS_OK;
}
