#include "cli/words.h"

#include "cli/options.h"
#include "ctsplat/ctsplat.h"
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

const char *cli_words(const char *text, char out[CLI_WORDS_MAX])
{
    out[0] = 0;
    FILE *file = fmemopen(out, CLI_WORDS_MAX, "w");
    while (file && *text) {
        const size_t n = *text == '{' ? put_word(file, text) : 0;
        if (!n)
            fputc(*text, file);
        text += n ? n : 1;
    }
    if (file)
        fclose(file);
    out[CLI_WORDS_MAX - 1] = 0;
    return out;
}

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
    for (const CliOption *o = cli_options; o->name; o++) {
        size_t same = 0;
        while (same < length && o->name[same] == (setting[same] == '_' ? '-' : setting[same]))
            same++;
        if (same == length && !o->name[same]) {
            fprintf(out, "--%s", o->name);
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
