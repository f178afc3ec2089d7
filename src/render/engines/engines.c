#include "render/engines/engines.h"

#include "base/enum_table.h"
#include <stdio.h>

#define DECLARED(id, name) extern const CtsEngine cts_engine_##name;
CTS_ENGINES(DECLARED)

#define NAME(id, name) #name,
const char *const cts_engine_names[CTS_N_ENGINES + 1] = {CTS_ENGINES(NAME) "auto"};

#define ROW(id, name) &cts_engine_##name,
static const CtsEngine *const engines[CTS_N_ENGINES] = {CTS_ENGINES(ROW)};

CTS_ENUM_TABLE(char *const, cts_engine_level_names,
               CTS_N_LEVELS, [CTS_LEVEL_AUTO] = "auto", [CTS_LEVEL_LATTICE] = "lattice", [CTS_LEVEL_SHEETS] = "sheets",
               [CTS_LEVEL_HALF_SHEETS] = "half-sheets", [CTS_LEVEL_HYBRID] = "hybrid");

const CtsEngine *cts_engine(CtsEngineId id)
{
    return engines[id];
}

CtsEngineId cts_engine_march(CtsEngineId id)
{
    for (int i = 0; i < CTS_N_ENGINES && !engines[id]->render_pixels; i++)
        id = engines[i]->render_pixels ? (CtsEngineId)i : id;
    return id;
}

CtsEngineId cts_engine_with_levels(void)
{
    int id = 0;
    while (id < CTS_N_ENGINES - 1 && !engines[id]->levels)
        id++;
    return (CtsEngineId)id;
}

CtsEngineId cts_engine_for_probes(void)
{
    enum { ALL_MODES = (1u << CTS_N_MODES) - 1 };
    int id = 0;
    while (id < CTS_N_ENGINES - 1 && !(engines[id]->modes == ALL_MODES && engines[id]->indicator))
        id++;
    return (CtsEngineId)id;
}

static bool has(const CtsEngine *engine, size_t column, int bit)
{
    const char *const at = (const char *)engine + column;
    return bit == CTS_ENGINE_FLAG ? *(const bool *)at : *(const unsigned *)at >> bit & 1;
}

const char *cts_engines_with(size_t column, int bit, char list[CTS_ENGINE_LIST_MAX])
{
    int left = 0;
    size_t at = 0;
    for (int i = 0; i < CTS_N_ENGINES; i++)
        left += has(engines[i], column, bit);
    list[0] = 0;
    for (int i = 0; i < CTS_N_ENGINES && at < CTS_ENGINE_LIST_MAX; i++)
        if (has(engines[i], column, bit)) {
            left--;
            at += (size_t)snprintf(list + at, CTS_ENGINE_LIST_MAX - at, "%s%s", engines[i]->name,
                                   left == 0   ? ""
                                   : left == 1 ? " and "
                                               : ", ");
        }
    return list;
}
