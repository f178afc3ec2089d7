/* Distances between macro-cells against the definition, on grids whose rows end inside, at and past a machine word. */
#include "engine/tiled/cell_distance.h"
#include "scenes.h"

static int by_definition(const uint8_t *marked, const int n[3], const int at[3])
{
    int least = CTS_CELL_FAR;
    for (int k = 0, i = 0; k < n[2]; k++)
        for (int v = 0; v < n[1]; v++)
            for (int u = 0; u < n[0]; u++, i++) {
                const int du = abs(u - at[0]), dv = abs(v - at[1]), dk = abs(k - at[2]);
                const int most = du > dv ? du > dk ? du : dk : dv > dk ? dv : dk;
                if (marked[i] == 0 && most < least)
                    least = most;
            }
    return least;
}

static void against_definition(void **state)
{
    static const int sizes[][3] = {{1, 1, 1}, {5, 4, 3}, {63, 2, 2}, {64, 3, 1}, {65, 2, 3}, {130, 1, 2}, {300, 1, 1}};
    uint64_t seed = 9;
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++)
        for (uint32_t one_in = 1; one_in <= 1000; one_in *= 10) {
            const int *n = sizes[s], total = n[0] * n[1] * n[2];
            uint8_t marked[800], found[800];
            assert_true(total <= 800);
            for (int i = 0; i < total; i++)
                found[i] = marked[i] = scene_random(&seed) % one_in != 0 ? (uint8_t)(1 + scene_random(&seed) % 255) : 0;
            cts_cell_distance(found, n[0], n[1], n[2]);
            for (int k = 0, i = 0; k < n[2]; k++)
                for (int v = 0; v < n[1]; v++)
                    for (int u = 0; u < n[0]; u++, i++)
                        assert_int_equal(found[i], by_definition(marked, n, (const int[3]){u, v, k}));
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(against_definition)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
