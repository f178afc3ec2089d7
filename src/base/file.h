/* Outputs that appear whole or not at all: a temporary file in the same folder, fsync, rename. */
#pragma once

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* Repeats short writes; false, with errno, on failure. */
bool cts_write_all(int fd, const void *data, size_t n);
/* The same into a socket, without a signal where its other end is closed. */
bool cts_send_all(int socket, const void *data, size_t n);

/* fsync(); true, too, where the file system has none, as those of object stores, which keep a file once it is closed.
 */
bool cts_sync_file(int fd);

/* Renames a file to a name that does not exist; false, with errno, on failure (EEXIST: it exists). In one step by
 * RENAME_NOREPLACE or a hard link; on file systems with neither, after a check, so that the later of two programs that
 * write one name at the same time wins there. */
bool cts_rename_new(const char *from, const char *to);

typedef struct CtsTempFile CtsTempFile;

/* Makes an unpredictable name beside path (mode 0600 until the commit). CTS_ERR_OUTPUT with path and cause. */
CtsStatus cts_temp_open(CtsTempFile **temp, const char *path, CtsError *err);
CtsStatus cts_temp_write(CtsTempFile *temp, const void *data, size_t n, CtsError *err);
/* At an offset, without changing the position of cts_temp_write(). */
CtsStatus cts_temp_write_at(CtsTempFile *temp, const void *data, size_t n, uint64_t offset, CtsError *err);
/* For libraries that need a name or a descriptor, which remain the temp file's. */
const char *cts_temp_path(const CtsTempFile *temp);
int cts_temp_fd(const CtsTempFile *temp);
/* fsync, close, mode 0666 less the umask (where the file system keeps modes), rename, fsync of the folder. Without
 * force an existing path is
 * CTS_ERR_OUTPUT. Frees temp. bytes may be NULL. */
CtsStatus cts_temp_commit(CtsTempFile **temp, bool force, uint64_t *bytes, CtsError *err);
/* A commit does not sync: for files that can be generated again after a power cut. */
void cts_temp_do_not_sync(CtsTempFile *temp);
/* A commit gives no access to others than the owner and, for reading, the group: for files that identify a patient. */
void cts_temp_keep_private(CtsTempFile *temp);
/* Removes the temporary file; does nothing when *temp is NULL, as after a commit. */
void cts_temp_discard(CtsTempFile **temp);

/* The n first bytes of a file, at most one more than `most`, and a 0 behind them; the caller's to free. fault: the
 * status where it cannot be read. */
CtsStatus cts_file_text(const char *path, size_t most, CtsStatus fault, char **text, size_t *n, CtsError *err);

/* $TMPDIR, or /tmp; and a new folder there with this prefix, accessible to its owner alone; *folder is to be freed. */
const char *cts_temp_root(void);
CtsStatus cts_temp_folder(const char *prefix, char **folder, CtsError *err);

/* The path of a user's own file by the XDG base directory specification: $VARIABLE/ctsplat/NAME, or below ~/FALLBACK;
 * made: its folders too, up to the last slash, for the user alone. False when neither is known. */
bool cts_user_path(char *path, size_t size, const char *variable, const char *fallback, const char *name, bool made);

/* CTS_OK when path could be written: its folder exists and is writable, and path is absent (or force is set and path
 * is a regular file). */
CtsStatus cts_file_check_writable(const char *path, bool force, CtsError *err);

CTS_C_END
