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

/* Writes the names of a list with blanks between them: views, kernels, else formats. */
static void put_list(FILE *out, char list)
{
    const char *const blank[2] = {"", " "};
    for (size_t i = 0; list == 'v' && i < CTS_N_VIEWS; i++)
        fprintf(out, "%s%s", blank[i > 0], cts_views[i].name);
    for (size_t i = 0; list == 'k' && i < CTS_N_KERNELS; i++)
        fprintf(out, "%s%s", blank[i > 0], cts_kernel_names[i]);
    for (size_t i = 0; list == 'f' && cts_format(i); i++)
        fprintf(out, "%s%s", blank[i > 0], cts_format(i)->name);
}

/* Markers for lists of names or of file name endings. */
static const struct {
    const char *word;
    bool has_names;
    bool (*wanted)(const CtsFormatInfo *format);
} markers[] = {
    {"{views}", true, NULL},    {"{kernels}", true, NULL},       {"{formats}", true, NULL},
    {"{outputs}", false, NULL}, {"{objects}", false, is_object}, {"{stacks}", false, has_many_frames},
};

/* Writes the list for the marker that text begins with; returns the marker's length, 0 where there is none. */
static size_t put_word(FILE *out, const char *text)
{
    for (size_t i = 0; i < sizeof markers / sizeof *markers; i++) {
        const size_t n = strlen(markers[i].word);
        char endings[CTS_ENDINGS_MAX];
        if (strncmp(text, markers[i].word, n) != 0)
            continue;
        if (markers[i].has_names)
            put_list(out, text[1]);
        else
            fputs(cts_format_endings(markers[i].wanted, endings), out);
        return n;
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
