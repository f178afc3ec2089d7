/* Limits of processors and memory by control groups (cgroup v2), of the process's own group and of its ancestors. */
#include "base/cpu.h"
#include "base/mem.h"

#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

/* The remainder of a resource by a group's files; INFINITY without a limit. */
typedef double (*ReadLimit)(const char *folder);

static FILE *open_in(const char *folder, const char *name)
{
    char path[PATH_MAX];
    const int size = snprintf(path, sizeof path, "%s/%s", folder, name);
    return size < (int)sizeof path ? fopen(path, "re") : NULL;
}

/* The first n numbers of a file; "max" is none. */
static int read_pair(const char *folder, const char *name, double value[2])
{
    FILE *file = open_in(folder, name);
    const int n = file ? fscanf(file, "%lf %lf", &value[0], &value[1]) : 0;
    if (file)
        fclose(file);
    return n;
}

/* Quota over period. */
static double read_cpus(const char *folder)
{
    double value[2];
    return read_pair(folder, "cpu.max", value) == 2 && value[0] > 0 && value[1] > 0 ? value[0] / value[1] : INFINITY;
}

static double read_number(const char *folder, const char *name, double otherwise)
{
    double value[2];
    return read_pair(folder, name, value) >= 1 ? value[0] : otherwise;
}

/* Bytes of the page cache that can be reclaimed. */
static double read_cache(const char *folder)
{
    char line[128];
    double sum = 0, value;
    FILE *file = open_in(folder, "memory.stat");
    while (file && fgets(line, sizeof line, file))
        if (sscanf(line, "inactive_file %lf", &value) == 1 || sscanf(line, "active_file %lf", &value) == 1)
            sum += value;
    if (file)
        fclose(file);
    return sum;
}

/* The limit minus the memory in use. */
static double read_memory(const char *folder)
{
    const double limit =
        fmin(read_number(folder, "memory.max", INFINITY), read_number(folder, "memory.high", INFINITY));
    return fmax(limit - fmax(read_number(folder, "memory.current", 0) - read_cache(folder), 0), 0);
}

/* The process's group: the line "0::GROUP". */
static bool find_group(const char *groups_path, char group[PATH_MAX])
{
    char line[PATH_MAX + 256];
    bool found = false;
    FILE *file = fopen(groups_path, "re");
    while (file && !found && fgets(line, sizeof line, file))
        if ((found = !strncmp(line, "0::", 3)))
            snprintf(group, PATH_MAX, "%.*s", (int)strcspn(line + 3, "\n"), line + 3);
    if (file)
        fclose(file);
    return found;
}

/* The least limit of the group and its ancestors. The mount may be of a group itself, as in a container without a
 * cgroup namespace: then the folders below it are missing, and have no limit. */
static double least_limit(const char *groups_path, const char *mount, ReadLimit read)
{
    char group[PATH_MAX], folder[2 * PATH_MAX], *slash;
    double least = INFINITY;
    if (!find_group(groups_path, group))
        return INFINITY;
    snprintf(folder, sizeof folder, "%s%s", mount, group);
    do {
        least = fmin(least, read(folder));
        slash = strrchr(folder + strlen(mount), '/');
        if (slash)
            *slash = 0;
    } while (slash);
    return least;
}

double cts_cpu_quota(const char *groups_path, const char *mount)
{
    return least_limit(groups_path, mount, read_cpus);
}

double cts_memory_quota(const char *groups_path, const char *mount)
{
    return least_limit(groups_path, mount, read_memory);
}
