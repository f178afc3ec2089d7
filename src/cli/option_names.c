/* Settings of the library as options of the program. */
#include "cli/option_names.h"

#include "app/words/options.h"
#include <stdio.h>
#include <string.h>

/* Settings whose option is not called like them. */
static const struct {
    const char *setting, *option;
} renamed[] = {
    {"void_key", "--void key"},      {"width", "--size"},           {"height", "--size"},
    {"tolerance_hu", "--tolerance"}, {"azimuth_deg", "--view"},     {"elevation_deg", "--view"},
    {"n_threads", "--threads"},      {"kernel_radius", "--kernel"}, {"compression", "--compress"},
    {"frames", "--rotation"},
};

/* Writes the option of the setting; false where there is none. */
static bool put_option(FILE *out, const char *setting, size_t length)
{
    for (size_t i = 0; i < sizeof renamed / sizeof *renamed; i++)
        if (strlen(renamed[i].setting) == length && !strncmp(renamed[i].setting, setting, length)) {
            fputs(renamed[i].option, out);
            return true;
        }
    for (const CtsOption *o = cts_options; o->name; o++) {
        size_t same = 0;
        while (same < length && o->name[same] == (setting[same] == '_' ? '-' : setting[same]))
            same++;
        if (same == length && !o->name[same]) {
            fprintf(out, o->commands == 1u << CTS_FOR_JOB ? "%.0sPATH" : "--%s", o->name);
            return true;
        }
    }
    return false;
}

const char *cli_with_options(const char *text, char *out, size_t size)
{
    out[0] = 0;
    FILE *file = fmemopen(out, size, "w");
    while (file && *text) {
        const size_t n = *text == '`' ? strcspn(text + 1, "`") : 0;
        if (n > 0 && text[1 + n] == '`' && put_option(file, text + 1, n))
            text += n + 2;
        else
            fputc(*text++, file);
    }
    if (file)
        fclose(file);
    out[size - 1] = 0;
    return out;
}
