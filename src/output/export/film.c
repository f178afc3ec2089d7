/* Films by the program ffmpeg, which gets raw frames through a socket: H.264 in MP4, and GIF. */
#include "output/export/format.h"

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
    pid_t pid;    /* 0: none */
    int frames;   /* ffmpeg's input; 0: closed */
    int messages; /* a file in memory with what ffmpeg prints: nothing unless it fails */
    uint8_t *row;
} FilmWriter;

static CtsStatus find_ffmpeg(const char *path, char program[PATH_MAX], CtsError *err)
{
    for (const char *at = getenv("PATH"); at && *at; at += strspn(at, ":")) {
        const int n = (int)strcspn(at, ":");
        if (snprintf(program, PATH_MAX, "%.*s/ffmpeg", n, at) < PATH_MAX && !access(program, X_OK))
            return CTS_OK;
        at += n;
    }
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: is made by the program ffmpeg, which is not in PATH (package ffmpeg)",
                    path);
}

static CtsStatus check_film(const char *path, const CtsExportSettings *settings, CtsError *err)
{
    char program[PATH_MAX];
    (void)settings;
    return find_ffmpeg(path, program, err);
}

static CtsStatus fail_film(const CtsExportJob *job, const FilmWriter *w, CtsError *err)
{
    char text[300] = "";
    const ssize_t n = pread(w->messages, text, sizeof text - 1, 0);
    text[n > 0 ? strcspn(text, "\n") : 0] = 0;
    cts_text_clean(text);
    if (strstr(text, "libx264"))
        return cts_fail(err, CTS_ERR_OUTPUT,
                        "%s: this ffmpeg has no libx264 (take one that has it, as Debian's package)", job->path);
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: ffmpeg: %s", job->path, *text ? text : "ended unexpectedly");
}

/* ffmpeg with the words of a format. Its bytes depend on the number of threads, which is fixed here, and on its
 * version.
 */
static CtsStatus begin_film(CtsExportJob *job, const char *format, CtsError *err)
{
    FilmWriter *const w = job->state;
    const int rate = job->settings.frame_rate;
    const char *arguments[MAX_ARGUMENTS];
    char program[PATH_MAX];
    char *words = NULL, *path = NULL, comment[CTS_DESCRIPTION + 8] = "comment=";
    int n = 0, pair[2];
    CtsStatus st = find_ffmpeg(job->path, program, err);
    if (st || (st = cts_alloc_array(&w->row, (size_t)job->head.width * 3, err)))
        return st;
    if ((w->messages = memfd_create("ffmpeg", MFD_CLOEXEC)) < 0 ||
        socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair))
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: ffmpeg cannot be connected: %s", job->path, strerror(errno));
    w->frames = pair[0];
    cts_describe_picture(&job->head.info, comment + strlen(comment));
    if (asprintf(&path, "file:%s", cts_temp_path(job->temp)) < 0 ||
        asprintf(&words,
                 "-hide_banner -loglevel error -xerror -f rawvideo -pixel_format rgb24 -video_size %dx%d "
                 "-framerate %d -i pipe:0 -fflags +bitexact -flags +bitexact -threads 4 %s -y",
                 job->head.width, job->head.height, rate ? rate : CTS_FRAME_RATE_DEFAULT, format) < 0)
        st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
    arguments[n++] = program;
    for (char *rest = words, *word; !st && (word = strsep(&rest, " "));)
        arguments[n++] = word;
    arguments[n++] = "-metadata";
    arguments[n++] = comment;
    arguments[n++] = path;
    arguments[n] = NULL;
    if (!st)
        st =
            cts_program_start(arguments, (int[]){pair[1], w->messages, w->messages}, (int[]){0, 1, 2}, 3, &w->pid, err);
    close(pair[1]);
    free(words);
    free(path);
    return st;
}

/* Even sizes, as H.264 with half the colours needs; colours as BT.709, which players assume. The default quality is CRF
 * 18, at which a film looks like its frames. */
static CtsStatus begin_mp4(CtsExportJob *job, CtsError *err)
{
    char words[300];
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
    FilmWriter *const w = job->state;
    const size_t n = (size_t)band->width * 3;
    for (int y = 0; y < band->height; y++) {
        cts_samples_row8(band, y, 3, w->row);
        for (size_t done = 0; done < n;) {
            const ssize_t sent = send(w->frames, w->row + done, n - done, MSG_NOSIGNAL);
            if (sent < 0 && errno != EINTR)
                return fail_film(job, w, err);
            done += sent > 0 ? (size_t)sent : 0;
        }
    }
    return CTS_OK;
}

/* A process that ignores its children gets no exit code; then the messages decide. */
static CtsStatus finish_film(CtsExportJob *job, CtsError *err)
{
    FilmWriter *const w = job->state;
    int code = 0;
    close(w->frames);
    w->frames = 0;
    while (waitpid(w->pid, &code, 0) < 0 && errno == EINTR)
        continue;
    w->pid = 0;
    return code || lseek(w->messages, 0, SEEK_END) ? fail_film(job, w, err) : CTS_OK;
}

static void release_film(CtsExportJob *job)
{
    FilmWriter *const w = job->state;
    if (w->frames)
        close(w->frames);
    if (w->messages > 0)
        close(w->messages);
    if (w->pid) {
        kill(w->pid, SIGKILL);
        while (waitpid(w->pid, NULL, 0) < 0 && errno == EINTR)
            continue;
    }
    cts_free(&w->row);
}

#define FILM(ending, text)                                                                                             \
    const CtsFormat cts_format_##ending = {                                                                            \
        .info = {#ending, text, .many_frames = true},                                                                  \
        .max_side = LARGEST,                                                                                           \
        .check = check_film,                                                                                           \
        .state_bytes = sizeof(FilmWriter),                                                                             \
        .begin = begin_##ending,                                                                                       \
        .rows = send_rows,                                                                                             \
        .finish = finish_film,                                                                                         \
        .close = release_film,                                                                                         \
    }
FILM(mp4, "H.264 film of a rotation, by the program ffmpeg");
FILM(gif, "GIF film of a rotation, 256 colours, by the program ffmpeg");
