/* One label file -> labels of a small series, counted; compressed frames have a process of their own and are left out.
 */
#include "dicom/header/slice.h"
#include "fuzz.h"
#include "input/files/nifti.h"
#include "input/labels/label_reading.h"
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { N_SLICES = 10, COLUMNS = 28, ROWS = 24 };

static CtsStatus read_dicom(const CtsLabelReading *reading, const CtsFile *file, CtsError *err)
{
    CtsLabelDicom object;
    CtsStatus st = cts_label_dicom_open(&object, file, err);
    if (!st && !object.head.facts.pixels.encapsulated && !(st = cts_label_check_patient(reading, &object, err)))
        st = strstr(object.class_uid, ".481.") ? cts_label_read_rtstruct(reading, &object, err)
                                               : cts_label_read_seg(reading, &object, err);
    cts_label_dicom_close(&object);
    return st;
}

static void check_runs(const CtsLabels *labels)
{
    for (size_t i = 0; i < labels->n; i++) {
        const CtsLabel *l = &labels->items[i];
        uint64_t n = 0;
        for (size_t r = 0; r < l->n_runs; r++) {
            assert(l->runs[r].row < N_SLICES * ROWS && l->runs[r].first < l->runs[r].end && l->runs[r].end <= COLUMNS);
            n += (uint64_t)(l->runs[r].end - l->runs[r].first);
        }
        assert(l->fact.voxels == n && l->fact.overlap <= n && l->fact.parts <= n && !l->fact.parts == !n);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    static const int number[N_SLICES] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
    CtsSlice slices[N_SLICES], *pointers[N_SLICES];
    for (int k = 0; k < N_SLICES; k++) {
        slices[k] = cts_slice_unknown();
        slices[k].row_lps[0] = slices[k].column_lps[1] = slices[k].normal_lps[2] = 1;
        slices[k].position_lps[2] = 9.5 * k;
        slices[k].column_spacing_mm = 8;
        slices[k].row_spacing_mm = 9;
        pointers[k] = &slices[k];
    }
    const CtsSeries series = {.n_slices = N_SLICES, .columns = COLUMNS, .rows = ROWS, .slices = pointers};
    CtsLabelGrid grid;
    CtsLabels *labels = NULL;
    CtsError err = {0};
    char class_uid[65];
    const CtsFileBytes file = {.fd = memfd_create("fuzz", MFD_CLOEXEC), .n_bytes = n};
    const CtsFile member = {.path = "fuzz", .memory = data, .n_memory = n};
    const CtsLabelNames names = {0};
    assert(write(file.fd, data, n) == (ssize_t)n);
    if (cts_label_grid_of(&grid, &series, &err) || cts_labels_new(&labels, &grid, &err)) {
        close(file.fd);
        return 0;
    }
    const CtsLabelReading reading = {.series = &series, .labels = labels, .file = 1, .names = &names};
    const CtsStatus st = cts_nifti_is(data, n)                    ? cts_label_read_nifti(&reading, &file, &err)
                         : cts_label_is_dicom(data, n, class_uid) ? read_dicom(&reading, &member, &err)
                                                                  : CTS_OK;
    assert(!st == !err.text[0]);
    if (!st && !cts_labels_begin(labels, &err) && !cts_labels_count(labels, number, N_SLICES, NULL, &err))
        check_runs(labels);
    cts_labels_free(&labels);
    close(file.fd);
    return 0;
}
