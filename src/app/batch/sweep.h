/* Temporary files (base/file.h) that a process left behind which was killed. */
#ifndef CTS_BATCH_SWEEP_H
#define CTS_BATCH_SWEEP_H

#include <stdint.h>
#include <sys/types.h>

/* Removes those of process pid, or with 0 all of them, whose names begin so; nobody else may be writing there. */
void cts_sweep(const char *folder, pid_t pid, const char *prefix);
/* All of them below -O: in the folders of this shard's series, and of its journal. */
void cts_sweep_all(const char *folder, int shard, int n_shards);

#endif
