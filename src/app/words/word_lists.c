#include "app/words/word_lists.h"

#include "ctsplat/export.h"
#include "ctsplat/render.h"
#include <stdio.h>
#include <string.h>

static void put_views(FILE *out)
{
    for (int i = 0; i < CTS_N_VIEWS; i++)
        fprintf(out, "%s%s", i ? " " : "", cts_views[i].name);
}

static void put_kernels(FILE *out)
{
    for (int i = 0; i < CTS_N_KERNELS; i++)
        fprintf(out, "%s%s", i ? " " : "", cts_kernel_names[i]);
}

static void put_formats(FILE *out)
{
    const CtsFormatInfo *format;
    for (size_t i = 0; (format = cts_format(i)); i++)
        fprintf(out, "%s%s", i ? " " : "", format->name);
}

static bool is_object(const CtsFormatInfo *format)
{
    return format->is_object;
}

static bool has_many_frames(const CtsFormatInfo *format)
{
    return format->many_frames;
}

static void put_endings(FILE *out, bool (*wanted)(const CtsFormatInfo *format))
{
    char endings[CTS_ENDINGS_MAX];
    fputs(cts_format_endings(wanted, endings), out);
}

static void put_outputs(FILE *out)
{
    put_endings(out, NULL);
}

static void put_objects(FILE *out)
{
    put_endings(out, is_object);
}

static void put_stacks(FILE *out)
{
    put_endings(out, has_many_frames);
}

static const struct {
    const char *word;
    void (*put)(FILE *out);
} words[] = {
    {"{views}", put_views},     {"{kernels}", put_kernels}, {"{outputs}", put_outputs},
    {"{formats}", put_formats}, {"{objects}", put_objects}, {"{stacks}", put_stacks},
};

/* Writes the word that text begins with; returns its length, 0 where there is none. */
static size_t put_word(FILE *out, const char *text)
{
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        const size_t n = strlen(words[i].word);
        if (!strncmp(text, words[i].word, n)) {
            words[i].put(out);
            return n;
        }
    }
    return 0;
}

const char *cts_word_lists(const char *text, char out[CTS_WORD_LISTS_MAX])
{
    out[0] = 0;
    FILE *file = fmemopen(out, CTS_WORD_LISTS_MAX, "w");
    while (file && *text) {
        const size_t n = *text == '{' ? put_word(file, text) : 0;
        if (!n)
            fputc(*text, file);
        text += n ? n : 1;
    }
    if (file)
        fclose(file);
    out[CTS_WORD_LISTS_MAX - 1] = 0;
    return out;
}
