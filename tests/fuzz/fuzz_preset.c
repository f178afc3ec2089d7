/* Presets in every format: accepted ones are valid, errors name the file. */
#include "core/transfer/preset_read.h"
#include "ctsplat/preset.h"
#include "fuzz.h"
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    static const char *const names[] = {"fuzz.json", "fuzz.vp", "fuzz.xml"};
    char *text = malloc(n + 2);
    CtsPreset preset;
    CtsError err = {0};
    if (!text || n == 0 || n > CTS_PRESET_MAX_BYTES) {
        free(text);
        return 0;
    }
    memcpy(text, data, n);
    text[n] = 0;
    const CtsStatus st = cts_preset_parse(text, n, names[data[0] % 3], NULL, &preset, &err);
    assert(st == CTS_OK || (err.text[0] && err.status == st));
    for (int i = 1; !st && i < preset.n_opacity; i++)
        assert(preset.opacity[i].hu >= preset.opacity[i - 1].hu);
    for (int i = 1; !st && i < preset.n_colour; i++)
        assert(preset.colour[i].hu >= preset.colour[i - 1].hu);
    free(text);
    return 0;
}
