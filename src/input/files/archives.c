#include "input/files/archive.h"

#include "base/mem.h"

#include <stdlib.h>
#include <string.h>

typedef struct Kept {
    char *path;
    CtsArchive *archive;
} Kept;

struct CtsArchives {
    Kept *items;
    size_t n;
};

CtsStatus cts_archives_add(CtsArchives **archives, const char *path, CtsArchive *archive, CtsError *err)
{
    CtsArchives *all = *archives ? *archives : calloc(1, sizeof *all);
    *archives = all;
    if (!all || cts_grow(&all->items, all->n, NULL)) {
        cts_archive_free(&archive);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    Kept *kept = &all->items[all->n++];
    *kept = (Kept){.path = strdup(path), .archive = archive};
    return kept->path ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

bool cts_archives_find(const CtsArchives *archives, const char *path, CtsFile *file)
{
    for (size_t i = 0; archives && i < archives->n; i++) {
        const Kept *kept = &archives->items[i];
        const size_t n = strlen(kept->path);
        if (strncmp(path, kept->path, n) || path[n] != '/')
            continue;
        const CtsMember wanted = {.name = path + n + 1};
        const CtsMember *member = bsearch(&wanted, kept->archive->members, (size_t)kept->archive->n_members,
                                          sizeof wanted, cts_member_by_name);
        if (!member || member->is_bad)
            continue;
        *file = (CtsFile){.path = path, .memory = member->bytes, .n_memory = member->n_bytes};
        return true;
    }
    return false;
}

void cts_archives_free(CtsArchives **archives)
{
    CtsArchives *all = *archives;
    if (!all)
        return;
    for (size_t i = 0; i < all->n; i++) {
        free(all->items[i].path);
        cts_archive_free(&all->items[i].archive);
    }
    free(all->items);
    free(all);
    *archives = NULL;
}
