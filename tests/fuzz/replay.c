/* Runs a fuzz target over files, whole, cut short and with single bytes changed: TARGET FOLDER... */
#include "fuzz.h"
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_BYTES = 1 << 20, N_CHANGES = 40 };
static int n_files;

/* In memory of exactly its size, so that a sanitizer detects an access beyond. */
static void run(const uint8_t *bytes, size_t n)
{
    uint8_t *exact = malloc(n ? n : 1);
    if (!exact)
        abort();
    if (n)
        memcpy(exact, bytes, n);
    LLVMFuzzerTestOneInput(exact, n);
    free(exact);
}

static int visit(const char *path, const struct stat *info, int type, struct FTW *ftw)
{
    static uint8_t bytes[MAX_BYTES];
    uint32_t random = 1;
    (void)info;
    (void)ftw;
    FILE *f = type == FTW_F ? fopen(path, "rbe") : NULL;
    if (!f)
        return 0;
    const size_t n = fread(bytes, 1, sizeof bytes, f);
    fclose(f);
    n_files++;
    run(bytes, n);
    for (int i = 0; i < N_CHANGES && n; i++) {
        random = random * 1664525u + 1013904223u;
        const size_t at = (random >> 8) % n;
        const uint8_t kept = bytes[at];
        run(bytes, at);
        bytes[at] ^= (uint8_t)(1 + (random & 0x7F));
        run(bytes, n);
        bytes[at] = kept;
    }
    return 0;
}

int main(int argc, char **argv)
{
    for (int i = 1; i < argc; i++)
        if (nftw(argv[i], visit, 16, FTW_PHYS))
            return 1;
    printf("%d files\n", n_files);
    return n_files ? 0 : 1;
}
