#include "core/scene/settings.h"

#define ROW(field, first, bounds, remakes)                                                                             \
    {offsetof(CtsRenderSettings, field), sizeof((CtsRenderSettings *)0)->field, bounds, CTS_REMAKES_##remakes},
const CtsSettingRow cts_setting_rows[CTS_N_SETTING_ROWS] = {CTS_RENDER_SETTINGS(ROW)};

/* A struct of the rows' fields has the layout of the settings only if the rows are in the same order. */
#define SAME_FIELD(field, first, bounds, remakes) __typeof__(((CtsRenderSettings *)0)->field) field;
struct Mirror {
    CTS_RENDER_SETTINGS(SAME_FIELD)
};
#define SAME_PLACE(field, first, bounds, remakes)                                                                      \
    _Static_assert(offsetof(struct Mirror, field) == offsetof(CtsRenderSettings, field), #field ": row out of order");
CTS_RENDER_SETTINGS(SAME_PLACE)

#define COUNTED(field, first, bounds, remakes) +((bounds) != 0)
_Static_assert(CTS_RENDER_SETTINGS(COUNTED) == CTS_SETTING_FRAMES - CTS_SETTING_WIDTH,
               "bounds of CtsRenderSettings that no row has");

/* By position, so that a field without a row is missing. */
#pragma GCC diagnostic error "-Wmissing-field-initializers"
#define DEFAULT(field, first, bounds, remakes) first,
void cts_render_defaults(CtsRenderSettings *settings)
{
    *settings = (CtsRenderSettings){CTS_RENDER_SETTINGS(DEFAULT)};
}
