#include "output/dcmtk/dcm_part.h"

#include "base/load_part.h"
#include <pthread.h>
#include <stdio.h>
#include <string.h>

/* The state of this file: the library, once it is loaded. */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static const CtsDcmPart *loaded;

static CtsStatus load(CtsError *err)
{
    void *symbol;
    cts_dcm_part_fn find;
    const CtsStatus st = cts_part_load(CTS_DCMTK_PART, "cts_dcm_part", &symbol, err);
    if (st)
        return cts_context(err, "what calls DCMTK");
    memcpy(&find, &symbol, sizeof find);
    loaded = find();
    return CTS_OK;
}

static void take_lock(void)
{
    pthread_mutex_lock(&lock);
}

static void leave_lock(void)
{
    pthread_mutex_unlock(&lock);
}

/* No process is forked while a thread loads the library. */
static void mind_forks(void)
{
    pthread_atfork(take_lock, leave_lock, leave_lock);
}

static CtsStatus find_part(const CtsDcmPart **part, CtsError *err)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, mind_forks);
    pthread_mutex_lock(&lock);
    const CtsStatus st = loaded ? CTS_OK : load(err);
    *part = loaded;
    pthread_mutex_unlock(&lock);
    return st;
}

/* Without the library no class has a name. */
void cts_dcm_class_name(const char *class_uid, char *text, size_t size)
{
    const CtsDcmPart *part;
    if (find_part(&part, NULL))
        snprintf(text, size, "of another SOP class");
    else
        part->class_name(class_uid, text, size);
}

char *cts_dcm_convert(const char *text, const char *charset)
{
    const CtsDcmPart *part;
    return find_part(&part, NULL) ? NULL : part->convert(text, charset);
}

CtsStatus cts_dcm_start(CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->start(err);
}

CtsStatus cts_dcm_start_decoders(CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->start_decoders(err);
}

CtsStatus cts_dcm_parse_header(const uint8_t *data_set, size_t n, const CtsSyntax *native, CtsTexts *texts,
                               char class_uid[65], CtsSlice *slice, CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->parse_header(data_set, n, native, texts, class_uid, slice, err);
}

CtsStatus cts_dcm_read_frames(const uint8_t *data_set, size_t n, const CtsSyntax *native, CtsTexts *texts,
                              CtsSlice ***frames, int *n_frames, CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->read_frames(data_set, n, native, texts, frames, n_frames, err);
}

CtsStatus cts_dcm_directory(const uint8_t *data_set, size_t n, const CtsSyntax *native, char ***files, size_t *n_files,
                            size_t *n_refused, CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->directory(data_set, n, native, files, n_files, n_refused, err);
}

CtsStatus cts_dcm_decode(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels, CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->decode(format, stream, n, pixels, err);
}

CtsStatus cts_dcm_ids(const char *path, CtsDcmIds *ids, CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->ids(path, ids, err);
}

CtsStatus cts_dcm_sc_source(const CtsSlice *slice, CtsScSource *source, CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->sc_source(slice, source, err);
}

CtsStatus cts_dcm_sc_header(const uint8_t *data_set, size_t n, const CtsSyntax *native, CtsScHeader *header,
                            CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->sc_header(data_set, n, native, header, err);
}

CtsStatus cts_dcm_sc_write(const CtsScObject *object, CtsScSink sink, void *context, CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->sc_write(object, sink, context, err);
}

CtsStatus cts_dcm_sc_encode(const char *syntax_uid, const CtsScFrame *frame, CtsScSink sink, void *context,
                            CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->sc_encode(syntax_uid, frame, sink, context, err);
}

CtsStatus cts_dcm_state_write(const CtsDcmState *state, CtsScSink sink, void *context, CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->state_write(state, sink, context, err);
}

CtsStatus cts_dcm_state_read(const char *path, char **preset, char **options, CtsError *err)
{
    const CtsDcmPart *part;
    const CtsStatus st = find_part(&part, err);
    return st ? st : part->state_read(path, preset, options, err);
}
