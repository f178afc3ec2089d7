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

static const char *name_of_view(size_t i)
{
    return i < CTS_N_VIEWS ? cts_views[i].name : NULL;
}

static const char *name_of_kernel(size_t i)
{
    return i < CTS_N_KERNELS ? cts_kernel_names[i] : NULL;
}

static const char *name_of_format(size_t i)
{
    return cts_format(i) ? cts_format(i)->name : NULL;
}

/* Markers for lists of names or of file name endings. */
static const struct {
    const char *word;
    const char *(*name)(size_t i);
    bool (*wanted)(const CtsFormatInfo *format);
} words[] = {
    {"{views}", name_of_view, NULL},     {"{kernels}", name_of_kernel, NULL}, {"{outputs}", NULL, NULL},
    {"{formats}", name_of_format, NULL}, {"{objects}", NULL, is_object},      {"{stacks}", NULL, has_many_frames},
};

/* Writes the list for the marker that text begins with; returns the marker's length, 0 where there is
 * none. */
static size_t put_word(FILE *out, const char *text)
{
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        const size_t n = strlen(words[i].word);
        if (!strncmp(text, words[i].word, n)) {
            char endings[CTS_ENDINGS_MAX];
            const char *name;
            if (!words[i].name)
                fputs(cts_format_endings(words[i].wanted, endings), out);
            for (size_t k = 0; words[i].name && (name = words[i].name(k)); k++)
                fprintf(out, "%s%s", k ? " " : "", name);
            return n;
        }
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
