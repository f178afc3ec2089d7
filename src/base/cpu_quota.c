/* The share of the processors that control groups leave to this process: cgroup v2's cpu.max and v1's cfs quota, of the
 * process's own group and of all those around it. */
#include "base/cpu.h"

#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Quota and period as a group's files have them; false where there is no quota. */
static bool read_quota(const char *folder, bool is_v2, double *cores)
{
    static const char *const names[2][2] = {{"cpu.cfs_quota_us", "cpu.cfs_period_us"}, {"cpu.max", NULL}};
    double value[2] = {0, 0};
    int n = 0;
    for (int i = 0; i < 2 && names[is_v2][i]; i++) {
        char path[PATH_MAX];
        const int size = snprintf(path, sizeof path, "%s/%s", folder, names[is_v2][i]);
        FILE *file = size < (int)sizeof path ? fopen(path, "re") : NULL;
        /* "max" is no number: no quota. */
        n += file ? fscanf(file, is_v2 ? "%lf %lf" : "%lf", &value[n > 0], &value[1]) : 0;
        if (file)
            fclose(file);
    }
    *cores = value[0] / value[1];
    return n == 2 && value[0] > 0 && value[1] > 0;
}

/* The least quota from folder up to the hierarchy's root, the first n_root bytes of it. */
static double least_quota(char *folder, size_t n_root, bool is_v2)
{
    double least = INFINITY, cores;
    for (;;) {
        if (read_quota(folder, is_v2, &cores))
            least = fmin(least, cores);
        char *slash = strrchr(folder, '/');
        if (!slash || (size_t)(slash - folder) < n_root)
            return least;
        *slash = 0;
    }
}

/* Whether a comma-separated list has the word. */
static bool has_word(const char *list, const char *word)
{
    const size_t n = strlen(word);
    for (const char *p = list; (p = strstr(p, word)); p += n)
        if ((p == list || p[-1] == ',') && (!p[n] || p[n] == ',' || p[n] == '\n'))
            return true;
    return false;
}

/* The process's group in a hierarchy: the line "0::GROUP", or "N:...,cpu,...:GROUP" in v1's. */
static bool find_group(const char *groups_path, bool is_v2, char group[PATH_MAX])
{
    char line[PATH_MAX + 256];
    bool found = false;
    FILE *file = fopen(groups_path, "re");
    while (file && !found && fgets(line, sizeof line, file)) {
        char *controllers = strchr(line, ':'), *path = controllers ? strchr(controllers + 1, ':') : NULL;
        if (!path)
            continue;
        *path++ = 0;
        path[strcspn(path, "\n")] = 0;
        found = is_v2 ? !strcmp(line, "0:") : has_word(controllers + 1, "cpu");
        snprintf(group, PATH_MAX, "%.*s", PATH_MAX - 1, path);
    }
    if (file)
        fclose(file);
    return found;
}

/* One line of mountinfo: ID PARENT DEVICE ROOT FOLDER OPTIONS ... - TYPE SOURCE OPTIONS. */
static double mount_quota(char *line, const char *groups_path)
{
    char root[PATH_MAX], mount[PATH_MAX], folder[2 * PATH_MAX], group[PATH_MAX], type[32], options[512];
    const char *tail = strstr(line, " - ");
    if (!tail || sscanf(line, "%*s %*s %*s %4095s %4095s", root, mount) != 2 ||
        sscanf(tail, " - %31s %*s %511s", type, options) != 2)
        return INFINITY;
    const bool is_v2 = !strcmp(type, "cgroup2");
    if ((!is_v2 && (strcmp(type, "cgroup") || !has_word(options, "cpu"))) || !find_group(groups_path, is_v2, group))
        return INFINITY;
    /* What is mounted may be a group itself, as in a container without a name space for groups. */
    const size_t n_root = strcmp(root, "/") ? strlen(root) : 0;
    const bool below = !strncmp(group, root, n_root) && (!group[n_root] || group[n_root] == '/');
    snprintf(folder, sizeof folder, "%s%s", mount, below && strcmp(group, "/") ? group + n_root : "");
    return least_quota(folder, strlen(mount), is_v2);
}

double cts_cpu_quota(const char *groups_path, const char *mounts_path)
{
    char *line = NULL;
    size_t size = 0;
    double least = INFINITY;
    FILE *file = fopen(mounts_path, "re");
    while (file && getline(&line, &size, file) > 0)
        least = fmin(least, mount_quota(line, groups_path));
    free(line);
    if (file)
        fclose(file);
    return least;
}
