/* The program ctsplat-dicom. */
#include "base/sandbox_worker.h"
#include "dicom/dcmtk/start_dcmtk.h"
#include "dicom/reader/reader.h"

int main(int argc, char **argv)
{
    static const CtsSandboxTask tasks[CTS_N_READER_TASKS] = {
        [CTS_READER_HEADERS] = {cts_reader_answer, cts_reader_prepare},
        [CTS_READER_OBJECT] = {cts_reader_answer, cts_reader_prepare},
        [CTS_READER_WRITE] = {cts_reader_answer, cts_dcm_start},
    };
    return cts_sandbox_serve(argc, argv, tasks, CTS_N_READER_TASKS);
}
