/* Films by the program ffmpeg, which gets raw frames through a socket: H.264 in MP4, and GIF. */
#include "output/export/format.h"

#include "base/file.h"
#include "base/libexec.h"
#include "base/mem.h"
#include "base/text.h"
#include "output/image/describe.h"
#include "output/image/samples.h"
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

/* LARGEST: ffmpeg's H.264 encoder and GIF's 16-bit sizes allow more, players do not. */
enum { LARGEST = 8192, MAX_ARGUMENTS = 48 };

typedef struct FilmWriter {
    pid_t pid;            /* 0: none */
    int frames, messages; /* ffmpeg's input; a file in memory with what it prints, nothing unless it fails; 0: none */
    uint8_t *row;
} FilmWriter;

/* Before any work: the program is in PATH. */
static CtsStatus check_film(const char *path, const CtsExportSettings *settings, CtsError *err)
{
    char program[PATH_MAX];
    (void)settings;
    for (const char *at = getenv("PATH"); at && *at; at += strcspn(at, ":"), at += strspn(at, ":")) {
        snprintf(program, sizeof program, "%.*s/ffmpeg", (int)strcspn(at, ":"), at);
        if (!access(program, X_OK))
            return CTS_OK;
    }
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: is made by the program ffmpeg, which is not in PATH (package ffmpeg)",
                    path);
}

static CtsStatus fail_film(const CtsExportJob *job, const FilmWriter *w, CtsError *err)
{
    char text[300] = "";
    const ssize_t n = pread(w->messages, text, sizeof text - 1, 0);
    text[n > 0 ? strcspn(text, "\n") : 0] = 0;
    cts_text_clean(text);
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: ffmpeg: %s%s", job->path, *text ? text : "ended unexpectedly",
                    strstr(text, "Unknown encoder") ? " (take one that has it, as Debian's package ffmpeg)" : "");
}

/* ffmpeg with a format's options. Its bytes depend on the number of threads, which is fixed here, and on its version.
 */
static CtsStatus begin_film(CtsExportJob *job, const char *format, CtsError *err)
{
    FilmWriter *const w = job->state;
    const CtsExportHead *const head = &job->head;
    const int rate = job->settings.frame_rate ? job->settings.frame_rate : CTS_FRAME_RATE_DEFAULT;
    const char *arguments[MAX_ARGUMENTS] = {NULL};
    char words[1000], path[PATH_MAX + 8], comment[CTS_DESCRIPTION + 8] = "comment=";
    int n = 0, pair[2];
    CtsStatus st = cts_alloc_array(&w->row, (size_t)head->width * 3, err);
    if (st)
        return st;
    if ((w->messages = memfd_create("ffmpeg", MFD_CLOEXEC)) < 0 ||
        socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair))
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: ffmpeg cannot be connected: %s", job->path, strerror(errno));
    w->frames = pair[0];
    cts_describe_picture(&head->info, comment + strlen(comment));
    snprintf(path, sizeof path, "file:%s", cts_temp_path(job->temp));
    snprintf(words, sizeof words,
             "ffmpeg -hide_banner -loglevel error -xerror -f rawvideo -pixel_format rgb24 -video_size %dx%d "
             "-framerate %d -i pipe:0 -fflags +bitexact -flags +bitexact -threads 4 %s -y -metadata",
             head->width, head->height, rate, format);
    for (char *rest = words; rest; n++)
        arguments[n] = strsep(&rest, " ");
    arguments[n++] = comment;
    arguments[n] = path;
    st = cts_program_start(arguments, (int[]){pair[1], w->messages, w->messages}, (int[]){0, 1, 2}, 3, &w->pid, err);
    close(pair[1]);
    return st;
}

/* Even sizes, as H.264 with half the colours needs; colours as BT.709, which players assume. The default quality is CRF
 * 18, at which a film looks like its frames. */
static CtsStatus begin_mp4(CtsExportJob *job, CtsError *err)
{
    char words[400];
    const int quality = job->settings.quality ? job->settings.quality : CTS_QUALITY_DEFAULT;
    snprintf(words, sizeof words,
             "-c:v libx264 -crf %d -pix_fmt yuv420p -vf "
             "crop=trunc(iw/2)*2:trunc(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv -colorspace bt709 "
             "-color_primaries bt709 -color_trc iec61966-2-1 -movflags +faststart -f mp4",
             36 - quality / 5);
    return begin_film(job, words, err);
}

/* 256 colours of each frame's own, so that memory does not grow with the number of frames. */
static CtsStatus begin_gif(CtsExportJob *job, CtsError *err)
{
    return begin_film(job, "-vf split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1 -f gif", err);
}

static CtsStatus send_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    const FilmWriter *const w = job->state;
    for (int y = 0; y < band->height; y++) {
        cts_samples_row8(band, y, 3, w->row);
        if (!cts_send_all(w->frames, w->row, (size_t)band->width * 3))
            return fail_film(job, w, err);
    }
    return CTS_OK;
}

/* The exit status, 0 for a process that ignores its children. */
static int end_ffmpeg(FilmWriter *w)
{
    int code = 0;
    if (w->frames)
        close(w->frames);
    if (w->pid)
        TEMP_FAILURE_RETRY(waitpid(w->pid, &code, 0));
    w->frames = w->pid = 0;
    return code;
}

static CtsStatus finish_film(CtsExportJob *job, CtsError *err)
{
    FilmWriter *const w = job->state;
    return end_ffmpeg(w) || lseek(w->messages, 0, SEEK_END) ? fail_film(job, w, err) : CTS_OK;
}

static void release_film(CtsExportJob *job)
{
    FilmWriter *const w = job->state;
    if (w->pid)
        kill(w->pid, SIGKILL);
    end_ffmpeg(w);
    if (w->messages > 0)
        close(w->messages);
    cts_free(&w->row);
}

#define FILM(ending, media_type, text)                                                                                 \
    const CtsFormat cts_format_##ending = {                                                                            \
        .info = {#ending, text, media_type, .many_frames = true},                                                      \
        .max_side = LARGEST,                                                                                           \
        .check = check_film,                                                                                           \
        .state_bytes = sizeof(FilmWriter),                                                                             \
        .begin = begin_##ending,                                                                                       \
        .rows = send_rows,                                                                                             \
        .finish = finish_film,                                                                                         \
        .close = release_film,                                                                                         \
    }
FILM(mp4, "video/mp4", "H.264 film of a rotation, by the program ffmpeg");
FILM(gif, "image/gif", "GIF film of a rotation, 256 colours, by the program ffmpeg");
