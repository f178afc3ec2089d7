#include "app/node/node.h"

#include "base/hash.h"
#include "dicom/header/slice.h"
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

void cts_spool_temp(const CtsSpool *spool, int i, char *path, size_t size)
{
    snprintf(path, size, "%s/.visitor-%d.tmp", spool->folder, i);
}

CtsStatus cts_spool_open(CtsSpool *spool, CtsError *err)
{
    spool->lock = -1;
    if (mkdir(spool->folder, 0750) && errno != EEXIST)
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be made: %s", spool->folder, strerror(errno));
    spool->lock = open(spool->folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (spool->lock < 0 || access(spool->folder, W_OK | X_OK))
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be written: %s", spool->folder, strerror(errno));
    if (flock(spool->lock, LOCK_EX | LOCK_NB))
        return cts_fail(err, CTS_ERR_INTERNAL, "%s: another receiver is running there (choose another -O)",
                        spool->folder);
    return CTS_OK;
}

void cts_spool_close(CtsSpool *spool)
{
    if (spool->lock >= 0)
        close(spool->lock);
    spool->lock = -1;
}

bool cts_spool_has_room(const CtsSpool *spool, uint64_t n_bytes)
{
    struct statvfs disk;
    return n_bytes <= spool->max_object_bytes && !statvfs(spool->folder, &disk) &&
           100.0 * (double)disk.f_bavail >= spool->free_percent * (double)disk.f_blocks;
}

/* The text itself where it is a UID, or else a number made from it. */
static bool name_after(const char *uid, bool may_be_itself, char *name, size_t size)
{
    CtsHash *hash;
    char hex[2 * CTS_DIGEST_BYTES + 1];
    if (may_be_itself && cts_uid_is_valid(uid))
        return snprintf(name, size, "%s", uid) < (int)size;
    if (cts_hash_start(&hash, NULL))
        return false;
    cts_hash_bytes(hash, uid, strlen(uid));
    return !cts_hash_hex(&hash, hex, NULL) && snprintf(name, size, "uid-%.16s", hex) < (int)size;
}

/* True if the file is the announced CT image; returns its study's folder. */
static bool read_study(const char *path, const char *sop_uid, char study[CTS_SPOOL_STUDY])
{
    CtsScratch scratch = {0};
    CtsObject object = {0};
    uint64_t bytes_read = 0;
    bool good = false;
    char name[CTS_SPOOL_STUDY - 3];
    cts_slice_read_header(&(CtsFile){.path = path}, &scratch, &object, &bytes_read, NULL);
    if (object.n_slices && !strcmp(object.slices[0]->sop_uid, sop_uid))
        good = name_after(object.slices[0]->identity[CTS_STUDY_UID], true, name, sizeof name) &&
               snprintf(study, CTS_SPOOL_STUDY, "ST_%s", name) > 0;
    cts_object_free(&object);
    cts_scratch_free(&scratch);
    return good;
}

/* Syncs a file, or a folder after a rename into it. */
static bool sync_file(const char *path)
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    const bool done = fd >= 0 && !fsync(fd);
    if (fd >= 0)
        close(fd);
    return done;
}

CtsStoredAs cts_spool_keep(const CtsSpool *spool, const char *path, const char *sop_uid, char study[CTS_SPOOL_STUDY],
                           bool *replaced)
{
    char name[40], folder[PATH_MAX], final[PATH_MAX];
    CtsStoredAs stored = CTS_STORED_NO_ROOM;
    if (!read_study(path, sop_uid, study)) {
        unlink(path);
        return CTS_STORED_NOT_CT;
    }
    if (name_after(sop_uid, false, name, sizeof name) &&
        snprintf(folder, sizeof folder, "%s/%s", spool->folder, study) < PATH_MAX &&
        snprintf(final, sizeof final, "%s/%s.dcm", folder, name) < PATH_MAX &&
        (mkdir(folder, 0750) ? errno == EEXIST : sync_file(spool->folder)) && sync_file(path)) {
        *replaced = !access(final, F_OK);
        if (!rename(path, final) && sync_file(folder))
            stored = CTS_STORED;
    }
    unlink(path); /* if it still exists */
    return stored;
}
