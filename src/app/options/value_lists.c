#include "app/options/options.h"

#include "ctsplat/export.h"
#include "ctsplat/render.h"
#include <stdio.h>
#include <string.h>

static bool is_object(const CtsFormatInfo *format)
{
    return format->is_object;
}

static bool has_many_frames(const CtsFormatInfo *format)
{
    return format->many_frames;
}

static int kernel_names(const char *names[CTS_NAMES_MAX])
{
    memcpy(names, cts_kernel_names, sizeof cts_kernel_names);
    return CTS_N_KERNELS;
}

/* Markers for lists of names (names) or of file name endings (wanted; NULL: all). */
static const struct {
    const char *word;
    int (*names)(const char *names[CTS_NAMES_MAX]);
    bool (*wanted)(const CtsFormatInfo *format);
} markers[] = {
    {"{views}", cts_view_names, NULL}, {"{kernels}", kernel_names, NULL}, {"{formats}", cts_format_names, NULL},
    {"{outputs}", NULL, NULL},         {"{objects}", NULL, is_object},    {"{stacks}", NULL, has_many_frames},
};

/* Writes the list for the marker that text begins with; returns the marker's length, 0 where there is none. */
static size_t put_word(FILE *out, const char *text)
{
    for (size_t i = 0; i < sizeof markers / sizeof *markers; i++) {
        char endings[CTS_ENDINGS_MAX];
        const char *names[CTS_NAMES_MAX];
        const int n = markers[i].names ? markers[i].names(names) : 0;
        if (strncmp(text, markers[i].word, strlen(markers[i].word)) != 0)
            continue;
        for (int k = 0; k < n; k++)
            fprintf(out, "%s%s", k ? " " : "", names[k]);
        if (!markers[i].names)
            fputs(cts_format_endings(markers[i].wanted, endings), out);
        return strlen(markers[i].word);
    }
    return 0;
}

const char *cts_value_lists(const char *text, char out[CTS_VALUE_LISTS_MAX])
{
    out[0] = 0;
    FILE *file = fmemopen(out, CTS_VALUE_LISTS_MAX, "w");
    while (file && *text) {
        const size_t n = *text == '{' ? put_word(file, text) : 0;
        if (!n)
            fputc(*text, file);
        text += n ? n : 1;
    }
    if (file)
        fclose(file);
    out[CTS_VALUE_LISTS_MAX - 1] = 0;
    return out;
}
