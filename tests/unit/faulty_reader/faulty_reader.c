/* ctsplat-dicom, but in a message with the text "reader:" it crashes, or, of a file alone, has the fault of the letter
 * behind that text. */
#include "base/sandbox_worker.h"
#include "dicom/dcmtk/start_dcmtk.h"
#include "dicom/reader/reader.h"
#include <signal.h>
#include <string.h>

static CtsStatus answer_badly(const void *order, const uint8_t *stream, size_t n, void *answer, size_t n_answer,
                              CtsError *err)
{
    const uint8_t *const fault = memmem(stream, n, "reader:", 7);
    const CtsStatus st = cts_reader_answer(order, stream, n, answer, n_answer, err);
    CtsHeaderAnswer *const first = answer;
    CtsReaderOrder o;
    memcpy(&o, order, sizeof o);
    switch (!fault ? 0 : o.n_files > 1 ? 'c' : fault[7]) {
    case 'c':
        raise(SIGSEGV);
        break;
    case 'm':
        return CTS_ERR_MEMORY;
    case 'n': /* noise */
        for (size_t i = 0; i < n_answer; i++)
            ((uint8_t *)answer)[i] = (uint8_t)(i * 7919 >> 3);
        break;
    case 'o': /* an offset beyond the answer */
        first->at = (uint64_t)1 << 60;
        break;
    case 'l': /* a loop of wishes */
        first->result = CTS_HEADER_MORE;
        first->need = (uint64_t)1 << 40;
        break;
    case 't': /* a text that does not end */
        memset((uint8_t *)answer + first->at + sizeof(CtsSlice), 'x', first->n - sizeof(CtsSlice));
        break;
    case 's': /* more slices than there are */
        first->object.n_slices = CTS_MAX_FRAMES;
        break;
    default:
        break;
    }
    return st;
}

int main(int argc, char **argv)
{
    static const CtsSandboxTask tasks[CTS_N_READER_TASKS] = {
        [CTS_READER_HEADERS] = {answer_badly, cts_reader_prepare}, [CTS_READER_WRITE] = {answer_badly, cts_dcm_start}};
    return cts_sandbox_serve(argc, argv, tasks, CTS_N_READER_TASKS);
}
