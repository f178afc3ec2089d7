#define _GNU_SOURCE
#include "output/report/bench_peers.h"

#include "base/mem.h"

#include <ctype.h>
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_PEERS = 10000 };

/* Names stand in a plot's script and in a page. */
static bool take_name(const json_t *object, const char *key, char name[40])
{
    const char *text = json_string_value(json_object_get(object, key));
    if (!text || strlen(text) >= 40)
        return false;
    for (const char *c = text; *c; c++)
        if (!isascii(*c) || (!isalnum(*c) && !strchr(" +-_.,:/()%=", *c)))
            return false;
    strcpy(name, text);
    return true;
}

static bool take_number(const json_t *object, const char *key, double low, double high, double *value)
{
    const json_t *number = json_object_get(object, key);
    *value = json_number_value(number);
    return json_is_number(number) && *value >= low && *value <= high;
}

/* NULL, or what the line lacks. */
static const char *take_line(const json_t *object, CtsBenchPeer *peer)
{
    double psnr_db;
    *peer = (CtsBenchPeer){.wall_ms = 0};
    if (!json_is_object(object))
        return "no JSON object";
    if (!take_name(object, "peer", peer->name) || !peer->name[0])
        return "`peer` is no name of 1 to 39 plain characters";
    if (json_object_get(object, "setting") && !take_name(object, "setting", peer->setting))
        return "`setting` is no text of up to 39 plain characters";
    if (!take_number(object, "wall_ms", 1e-6, 1e9, &peer->wall_ms))
        return "`wall_ms` is no time of one picture";
    if (take_number(object, "rmse", 1e-12, 1, &peer->rmse))
        return NULL;
    if (!take_number(object, "psnr_db", 0, 240, &psnr_db))
        return "neither `rmse` nor `psnr_db` is an error over display values from 0 to 1";
    peer->rmse = pow(10, -psnr_db / 20);
    return NULL;
}

static CtsStatus add_line(CtsBenchPeers *peers, const char *path, int number, const char *line, CtsError *err)
{
    json_error_t why;
    json_t *object = json_loads(line, JSON_REJECT_DUPLICATES, &why);
    CtsBenchPeer peer;
    const char *wrong = take_line(object, &peer);
    json_decref(object);
    if (wrong)
        return cts_fail(err, CTS_ERR_USAGE, "%s: line %d: %s", path, number, wrong);
    if (peers->n == MOST_PEERS)
        return cts_fail(err, CTS_ERR_USAGE, "%s: more than %d lines", path, MOST_PEERS);
    const CtsStatus st = cts_grow(&peers->peers, peers->n, err);
    if (!st)
        peers->peers[peers->n++] = peer;
    return st;
}

CtsStatus cts_bench_peers_read(const char *path, CtsBenchPeers *peers, CtsError *err)
{
    CtsStatus st = CTS_OK;
    char *line = NULL;
    size_t size = 0;
    *peers = (CtsBenchPeers){.n = 0};
    FILE *file = fopen(path, "re");
    if (!file)
        return cts_fail(err, CTS_ERR_USAGE, "%s: %s", path, strerror(errno));
    for (int number = 1; !st && getline(&line, &size, file) >= 0; number++)
        if (line[strspn(line, " \t\r\n")])
            st = add_line(peers, path, number, line, err);
    if (!st && ferror(file))
        st = cts_fail(err, CTS_ERR_USAGE, "%s: cannot be read", path);
    if (!st && !peers->n)
        st = cts_fail(err, CTS_ERR_USAGE, "%s: holds no line of a peer", path);
    fclose(file);
    free(line);
    if (st)
        cts_bench_peers_free(peers);
    return st;
}

void cts_bench_peers_free(CtsBenchPeers *peers)
{
    free(peers->peers);
    *peers = (CtsBenchPeers){.n = 0};
}
