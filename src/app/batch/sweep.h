/* Temporary files (base/file.h) that a process left behind which was killed. */
#ifndef CTS_BATCH_SWEEP_H
#define CTS_BATCH_SWEEP_H

/* Removes those whose names begin so; nobody else may be writing there. */
void cts_sweep(const char *folder, const char *prefix);
/* All of them below -O; of a shard its journal's alone, as other shards are at work: the folder of a series is swept
 * when the series is made. */
void cts_sweep_all(const char *folder, int shard, int n_shards);

#endif
