/* Other renderers' times and errors on the same scene, measured elsewhere, for the bench's plot and page. */
#ifndef CTS_REPORT_BENCH_PEERS_H
#define CTS_REPORT_BENCH_PEERS_H

#include "ctsplat/status.h"

typedef struct CtsBenchPeer {
    char name[40], setting[40]; /* plain ASCII without quotes; setting may be empty */
    double wall_ms, rmse;       /* of one picture; against the converged trilinear integral, display values 0..1 */
} CtsBenchPeer;

typedef struct CtsBenchPeers {
    CtsBenchPeer *peers; /* in the file's order */
    int n;
} CtsBenchPeers;

/* A JSON Lines file: an object a line with peer, wall_ms, rmse or psnr_db, and setting if it likes; blank lines and
 * other keys are passed over. CTS_ERR_USAGE, with the line, when it holds anything else. Free with
 * cts_bench_peers_free(). */
CtsStatus cts_bench_peers_read(const char *path, CtsBenchPeers *peers, CtsError *err);
void cts_bench_peers_free(CtsBenchPeers *peers);

#endif
