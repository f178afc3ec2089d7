/* Thumbnails by DICOMweb (PS3.18 10.4.1.1.4): the picture of the contact sheet, or an object's own slice. They are kept
 * on disk, named by a hash of all that decides their bytes. */
#include "app/serve/server.h"

#include "base/file.h"
#include "base/hash.h"
#include "dicom/codec/pixels.h"
#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/* Seconds for which a thumbnail is kept: 90 days. A later request renders it again. */
static const time_t KEPT_S = 90L * 24 * 60 * 60;

static void remove_old(const char *folder)
{
    DIR *const dir = opendir(folder);
    struct dirent *entry;
    struct stat file;
    while (dir && (entry = readdir(dir)))
        if (!fstatat(dirfd(dir), entry->d_name, &file, AT_SYMLINK_NOFOLLOW) && S_ISREG(file.st_mode) &&
            file.st_mtime < time(NULL) - KEPT_S)
            unlinkat(dirfd(dir), entry->d_name, 0);
    if (dir)
        closedir(dir);
}

void cts_thumbnails_begin(CtsServer *server, void (*note)(const char *text))
{
    char *const folder = server->thumbnails;
    if (!cts_user_path(folder, sizeof server->thumbnails, "XDG_CACHE_HOME", ".cache", "thumbnails/", true) ||
        access(folder, W_OK | X_OK)) {
        note("thumbnails are not kept: ctsplat/thumbnails in $XDG_CACHE_HOME, or ~/.cache, cannot be written");
        folder[0] = 0;
        return;
    }
    remove_old(folder);
    cts_names_add(&server->names, folder);
}

/* The object's slice; of a series that is no volume the middle one, as on the contact sheet. */
static CtsStatus choose_slice(const CtsServer *server, CtsRenderRequest *r, CtsError *err)
{
    const CtsSeries *const s = r->cached->series;
    const char *const uid = r->render_query.instance_uid;
    int i = uid[0] ? 0 : s->n_slices / 2;
    r->slice = NULL;
    if (!uid[0] && s->renderable)
        return CTS_OK;
    while (uid[0] && i < s->n_slices && strcmp(s->slices[i]->sop_uid, uid))
        i++;
    if (i == s->n_slices)
        return cts_fail(err, CTS_ERR_NO_SERIES, "there is no such object here");
    if (!uid[0] && !s->passed)
        return cts_fail(err, CTS_ERR_NO_SERIES, "%s", s->reason);
    if (s->may_name && !server->options->show_patient)
        return cts_fail(err, CTS_ERR_NO_SERIES,
                        "its pixels may show the patient's name (see --show-patient of ctsplat serve)");
    r->slice = s->slices[i];
    return CTS_OK;
}

static void hash_slice(CtsHash *hash, const CtsSlice *slice)
{
    cts_hash_text(hash, slice->path);
    cts_hash_text(hash, slice->sop_uid);
    cts_hash_bytes(hash, &slice->file_bytes, sizeof slice->file_bytes);
    cts_hash_bytes(hash, &slice->mtime_ns, sizeof slice->mtime_ns);
    cts_hash_bytes(hash, &slice->frame, sizeof slice->frame);
}

static CtsStatus name_thumbnail(CtsRenderRequest *r, char name[2 * CTS_DIGEST_BYTES + 1], CtsError *err)
{
    const CtsSeries *const s = r->cached->series;
    const CtsRenderSettings *const render = &r->render_query.job.render;
    CtsHash *hash = cts_hash_start(NULL);
    char text[96];
    snprintf(text, sizeof text, CTS_VERSION " %dx%d %d %d %u %s", render->width, render->height,
             s->rules.allow_missing_slices, (int)s->rules.nifti_form, s->rules.named_quantity,
             r->slice ? "slice" : "volume");
    cts_hash_text(hash, text);
    cts_hash_text(hash, r->render_query.media_type);
    for (int i = 0; i < (r->slice ? 1 : s->n_slices); i++)
        hash_slice(hash, r->slice ? r->slice : s->slices[i]);
    return cts_hash_hex(&hash, name, err);
}

CtsStatus cts_thumbnail_find(const CtsServer *server, CtsRenderRequest *r, CtsError *err)
{
    CtsRenderQuery *const q = &r->render_query;
    const char *const has = cts_http_header(r->request, "If-None-Match");
    char name[2 * CTS_DIGEST_BYTES + 1], *path = NULL;
    CtsStatus st = choose_slice(server, r, err);
    if (st || (st = name_thumbnail(r, name, err)))
        return st;
    snprintf(r->etag, sizeof r->etag, "\"%s\"", name);
    if (server->thumbnails[0] && asprintf(&path, "%s%s%s", server->thumbnails, name, strrchr(q->path, '.')) < 0)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (path) {
        free(q->path);
        q->path = path;
        q->job.outputs.paths = (const char *const *)&q->path;
        q->job.export.force = true; /* another server may have made it meanwhile */
    }
    r->is_kept = (path && !access(path, R_OK)) || (has && strstr(has, r->etag));
    return CTS_OK;
}

CtsStatus cts_thumbnail_draw(CtsRenderRequest *r, CtsError *err)
{
    const CtsJob *const job = &r->render_query.job;
    CtsPicture *picture = NULL;
    CtsStatus st = cts_slice_picture(r->slice, job->render.width, job->render.height, &picture, err);
    if (!st)
        st = cts_export((const CtsPicture *const *)&picture, 1, job->outputs.paths[0], &job->export, NULL, &r->report,
                        err);
    cts_picture_free(&picture);
    return st;
}
