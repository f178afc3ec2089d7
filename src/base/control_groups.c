/* Limits of processors and memory by control groups: cgroup v2's files and v1's, of the process's own group and of its
 * ancestors. */
#include "base/cpu.h"
#include "base/mem.h"

#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The remainder of a resource by a group's files; INFINITY without a limit. */
typedef double (*ReadLimit)(const char *folder, bool is_v2);

typedef struct Resource {
    const char *controller; /* its name in v1's hierarchies */
    ReadLimit read;
} Resource;

static FILE *open_in(const char *folder, const char *name)
{
    char path[PATH_MAX];
    const int size = snprintf(path, sizeof path, "%s/%s", folder, name);
    return size < (int)sizeof path ? fopen(path, "re") : NULL;
}

/* Quota over period. */
static double read_cpus(const char *folder, bool is_v2)
{
    static const char *const names[2][2] = {{"cpu.cfs_quota_us", "cpu.cfs_period_us"}, {"cpu.max", NULL}};
    double value[2] = {0, 0};
    int n = 0;
    for (int i = 0; i < 2 && names[is_v2][i]; i++) {
        FILE *file = open_in(folder, names[is_v2][i]);
        /* "max" is no number: no quota. */
        n += file ? fscanf(file, is_v2 ? "%lf %lf" : "%lf", &value[n > 0], &value[1]) : 0;
        if (file)
            fclose(file);
    }
    return n == 2 && value[0] > 0 && value[1] > 0 ? value[0] / value[1] : INFINITY;
}

static double read_number(const char *folder, const char *name, double otherwise)
{
    double value;
    FILE *file = open_in(folder, name);
    const bool found = file && fscanf(file, "%lf", &value) == 1;
    if (file)
        fclose(file);
    return found ? value : otherwise;
}

/* Bytes of the page cache that can be reclaimed. */
static double read_cache(const char *folder, bool is_v2)
{
    char line[128];
    double sum = 0, value;
    FILE *file = open_in(folder, "memory.stat");
    while (file && fgets(line, sizeof line, file))
        if (sscanf(line, is_v2 ? "inactive_file %lf" : "total_inactive_file %lf", &value) == 1 ||
            sscanf(line, is_v2 ? "active_file %lf" : "total_active_file %lf", &value) == 1)
            sum += value;
    if (file)
        fclose(file);
    return sum;
}

/* The limit minus the memory in use; v1 writes "no limit" as a number near 2^63. */
static double read_memory(const char *folder, bool is_v2)
{
    const double limit = is_v2 ? fmin(read_number(folder, "memory.max", INFINITY), //
                                      read_number(folder, "memory.high", INFINITY))
                               : read_number(folder, "memory.limit_in_bytes", INFINITY);
    if (limit > 0x1p60)
        return INFINITY;
    const double used = read_number(folder, is_v2 ? "memory.current" : "memory.usage_in_bytes", 0);
    return fmax(limit - fmax(used - read_cache(folder, is_v2), 0), 0);
}

/* The least limit from folder up to the hierarchy's root, the first n_root bytes of it. */
static double least_in(char *folder, size_t n_root, bool is_v2, ReadLimit read)
{
    double least = INFINITY;
    for (;;) {
        least = fmin(least, read(folder, is_v2));
        char *slash = strrchr(folder, '/');
        if (!slash || (size_t)(slash - folder) < n_root)
            return least;
        *slash = 0;
    }
}

/* True if a comma-separated list contains the word. */
static bool has_word(const char *list, const char *word)
{
    const size_t n = strlen(word);
    for (const char *p = list; (p = strstr(p, word)); p += n)
        if ((p == list || p[-1] == ',') && (!p[n] || p[n] == ',' || p[n] == '\n'))
            return true;
    return false;
}

/* The process's group in a hierarchy: the line "0::GROUP", or "N:...,cpu,...:GROUP" in v1's. */
static bool find_group(const char *groups_path, bool is_v2, const char *controller, char group[PATH_MAX])
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
        found = is_v2 ? !strcmp(line, "0:") : has_word(controllers + 1, controller);
        snprintf(group, PATH_MAX, "%.*s", PATH_MAX - 1, path);
    }
    if (file)
        fclose(file);
    return found;
}

/* One line of mountinfo: ID PARENT DEVICE ROOT FOLDER OPTIONS ... - TYPE SOURCE OPTIONS. */
static double least_of_mount(char *line, const char *groups_path, const Resource *resource)
{
    char root[PATH_MAX], mount[PATH_MAX], folder[2 * PATH_MAX], group[PATH_MAX], type[32], options[512];
    const char *tail = strstr(line, " - ");
    if (!tail || sscanf(line, "%*s %*s %*s %4095s %4095s", root, mount) != 2 ||
        sscanf(tail, " - %31s %*s %511s", type, options) != 2)
        return INFINITY;
    const bool is_v2 = !strcmp(type, "cgroup2");
    if ((!is_v2 && (strcmp(type, "cgroup") || !has_word(options, resource->controller))) ||
        !find_group(groups_path, is_v2, resource->controller, group))
        return INFINITY;
    /* The mount may be of a group itself, as in a container without a cgroup namespace. */
    const size_t n_root = strcmp(root, "/") ? strlen(root) : 0;
    const bool below = !strncmp(group, root, n_root) && (!group[n_root] || group[n_root] == '/');
    snprintf(folder, sizeof folder, "%s%s", mount, below && strcmp(group, "/") ? group + n_root : "");
    return least_in(folder, strlen(mount), is_v2, resource->read);
}

static double least_limit(const char *groups_path, const char *mounts_path, const Resource *resource)
{
    char *line = NULL;
    size_t size = 0;
    double least = INFINITY;
    FILE *file = fopen(mounts_path, "re");
    while (file && getline(&line, &size, file) > 0)
        least = fmin(least, least_of_mount(line, groups_path, resource));
    free(line);
    if (file)
        fclose(file);
    return least;
}

double cts_cpu_quota(const char *groups_path, const char *mounts_path)
{
    return least_limit(groups_path, mounts_path, &(Resource){"cpu", read_cpus});
}

double cts_memory_quota(const char *groups_path, const char *mounts_path)
{
    return least_limit(groups_path, mounts_path, &(Resource){"memory", read_memory});
}
