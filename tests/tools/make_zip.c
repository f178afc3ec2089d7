/* make_zip OUT FILE...: a zip file of these files, each under its last two path parts; the same bytes every time. */
#include <stdio.h>
#include <string.h>
#include <zip.h>

static const char *last_parts(const char *path)
{
    const char *start = path + strlen(path);
    for (int slashes = 0; start > path; start--)
        if (start[-1] == '/' && ++slashes == 2)
            break;
    return start;
}

int main(int argc, char **argv)
{
    zip_t *zip = argc > 2 ? zip_open(argv[1], ZIP_CREATE | ZIP_TRUNCATE, NULL) : NULL;
    for (int i = 2; zip && i < argc; i++) {
        zip_source_t *source = zip_source_file(zip, argv[i], 0, -1);
        const zip_int64_t at = source ? zip_file_add(zip, last_parts(argv[i]), source, 0) : -1;
        if (at < 0 || zip_file_set_dostime(zip, (zip_uint64_t)at, 0, 33, 0) ||
            zip_set_file_compression(zip, (zip_uint64_t)at, i % 2 ? ZIP_CM_STORE : ZIP_CM_DEFLATE, 0) ||
            zip_file_set_external_attributes(zip, (zip_uint64_t)at, 0, ZIP_OPSYS_DOS, 0)) {
            fprintf(stderr, "make_zip: %s: %s\n", argv[i], zip_strerror(zip));
            return 1;
        }
    }
    if (!zip || zip_close(zip)) {
        fprintf(stderr, "make_zip: nothing was written\n");
        return 1;
    }
    return 0;
}
