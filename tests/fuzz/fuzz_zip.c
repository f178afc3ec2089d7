/* A zip file through the unpacker and the list of its members, both in this process. */
#include "dicom/pixels/pixel_tasks.h"
#include "fuzz.h"
#include "input/files/archive.h"
#include <stdlib.h>
#include <string.h>

enum { ROOM = 1 << 20 };

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    uint8_t *room = calloc(1, ROOM);
    CtsArchive *archive = calloc(1, sizeof *archive);
    CtsError err = {0};
    assert(archive);
    if (room && !cts_pixels_unzip(NULL, data, n, room, ROOM, &err) && !cts_archive_list(archive, room, ROOM, &err))
        for (int i = 0; i < archive->n_members; i++) {
            const CtsMember m = archive->members[i];
            assert(m.name[0] && m.n_bytes > 0 && m.bytes >= room && m.n_bytes <= (uint64_t)(room + ROOM - m.bytes));
        }
    cts_archives_free(&archive);
    /* The list alone: a compromised unpacker may write anything. */
    if (room && n <= ROOM && (archive = calloc(1, sizeof *archive))) {
        memcpy(room, data, n);
        cts_archive_list(archive, room, ROOM, &err);
        cts_archives_free(&archive);
    }
    free(room);
    return 0;
}
