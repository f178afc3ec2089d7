/* A file's first bytes -> framing, data set, slices. */
#include "dicom/dcmtk/start_dcmtk.h"
#include "dicom/reader/dcmtk_attributes.hpp"
#include "dicom/reader/reader.h"
#include "dicom/reader/tag_scan.h"
#include "dicom/writer/dcmtk_write.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <new>
#include <stdexcept>

namespace
{

enum {
    MAX_DEFLATED_FILE = 16 << 20, /* read whole for its header; a slice of 512 x 512 is 0.5 MB */
    FIRST_INFLATE = 64 << 10      /* holds most headers; doubled where it does not */
};

/* One file's header while it is read. */
struct Header {
    const uint8_t *bytes;
    const CtsHeaderItem &item;
    const CtsReaderOrder &order;
    CtsElements records; /* of the order */
    CtsHeaderAnswer &answer;
    CtsMetaScan meta;
    CtsDataScan scan;
    const CtsSyntax *syntax, *native; /* of the file, NULL: not known; of its data set, uncompressed */
    std::vector<uint8_t> inflated;
};

CtsHeaderResult refuse(Header &h, const char *format, ...) __attribute__((format(printf, 2, 3)));
CtsHeaderResult refuse(Header &h, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    std::vsnprintf(h.answer.why, sizeof h.answer.why, format, args);
    va_end(args);
    return CTS_HEADER_BAD;
}

/* Bytes beyond those at hand are needed. */
CtsHeaderResult ask_for(Header &h, uint64_t need, const char *what)
{
    if (h.item.n >= h.item.n_file)
        return refuse(h, "damaged or cut short: its %s does not end", what);
    h.answer.need = need;
    return CTS_HEADER_MORE;
}

/* The encoding of the data set: by its meta header, else by detection. */
CtsHeaderResult find_syntax(Header &h)
{
    CtsHeaderFacts &facts = h.answer.facts;
    const CtsSyntax *const looks = cts_scan_guess(h.bytes + h.meta.data_offset, h.item.n - h.meta.data_offset);
    const char *uid = h.meta.syntax_uid;
    if (!h.meta.has_preamble)
        facts.deviations |= CTS_DEVIATION_NO_PREAMBLE;
    h.syntax = cts_syntax_find(uid);
    if (!*uid) {
        facts.deviations |= CTS_DEVIATION_NO_SYNTAX;
        if (!looks)
            return refuse(h, "has no transfer syntax, and its data set fits none");
        h.syntax = looks;
        uid = looks->uid;
    }
    std::snprintf(facts.syntax_uid, sizeof facts.syntax_uid, "%s", uid);
    /* One that is unknown hides the pixels, hardly ever the header. */
    const CtsSyntax *const syntax = h.syntax ? h.syntax : looks;
    h.native = syntax ? cts_syntax_native(syntax->explicit_vr, syntax->big_endian) : cts_syntax_native(true, false);
    return CTS_HEADER_DONE;
}

/* Checks the framing of n of n_all bytes. */
CtsScanResult scan(Header &h, const uint8_t *bytes, size_t n, uint64_t n_all, size_t start)
{
    return cts_scan_data(bytes, n, n_all, start, h.native, h.order.max_header, &h.scan);
}

CtsHeaderResult scan_plain(Header &h)
{
    const CtsScanResult result = scan(h, h.bytes, h.item.n, h.item.n_file, h.meta.data_offset);
    if (result == CTS_SCAN_MORE)
        return ask_for(h, h.scan.need, "header");
    return result == CTS_SCAN_DONE ? CTS_HEADER_DONE : refuse(h, "damaged or cut short: %s", h.scan.why);
}

/* A deflated data set is inflated only up to its pixels, within the header limit. */
CtsHeaderResult scan_deflated(Header &h)
{
    const size_t start = h.meta.data_offset;
    CtsError err = {};
    if (h.item.n_file > MAX_DEFLATED_FILE)
        return refuse(h, "is a deflated file of more than 16 MiB (inflate it with dcmconv +te)");
    if (h.item.n < h.item.n_file)
        return ask_for(h, h.item.n_file, "header");
    for (size_t want = FIRST_INFLATE; want <= h.order.max_header; want *= 2) {
        size_t got = 0;
        h.inflated.resize(want);
        if (cts_inflate(h.bytes + start, h.item.n - start, 0, h.inflated.data(), want, &got, &err))
            return refuse(h, "%s", err.text);
        const CtsScanResult result = scan(h, h.inflated.data(), got, got < want ? got : UINT64_MAX, 0);
        if (result == CTS_SCAN_BAD || (result == CTS_SCAN_MORE && got < want))
            return refuse(h, "damaged or cut short: %s",
                          result == CTS_SCAN_BAD ? h.scan.why : "its header does not end");
        if (result == CTS_SCAN_DONE)
            return CTS_HEADER_DONE;
    }
    return refuse(h, "more than %zu MiB precede the pixels", static_cast<size_t>(h.order.max_header >> 20));
}

CtsHeaderResult read_data_set(Header &h, DcmDataset &data)
{
    const bool deflated = h.syntax && h.syntax->deflated;
    const uint8_t *const start = deflated ? h.inflated.data() : h.bytes + h.meta.data_offset;
    const size_t n = h.scan.header_end - (deflated ? 0 : h.meta.data_offset);
    DcmInputBufferStream in;
    in.setBuffer(start, static_cast<offile_off_t>(n));
    in.setEos();
    data.transferInit();
    const OFCondition parsed = n ? data.read(in, DcmXfer(h.native->uid).getXfer(), EGL_noChange) : EC_Normal;
    data.transferEnd();
    if (parsed.bad())
        return refuse(h, "damaged: DCMTK cannot read its data set (%s)", parsed.text());
    return CTS_HEADER_DONE;
}

CtsHeaderResult read_header(Header &h, DcmDataset &data)
{
    const CtsScanResult meta = cts_scan_meta(h.bytes, h.item.n, h.item.n_file, &h.meta);
    if (meta == CTS_SCAN_MORE)
        return ask_for(h, h.meta.need, "meta header");
    if (meta == CTS_SCAN_NOT_DICOM)
        return refuse(h, "is no DICOM file");
    if (meta != CTS_SCAN_DONE)
        return refuse(h, "damaged or cut short: %s", h.meta.why);
    CtsHeaderResult result = find_syntax(h);
    if (result == CTS_HEADER_DONE)
        result = h.syntax && h.syntax->deflated ? scan_deflated(h) : scan_plain(h);
    /* Apparent damage is in fact an unknown encoding. */
    if (result == CTS_HEADER_BAD && !h.syntax && *h.meta.syntax_uid)
        return refuse(h, "transfer syntax %s is unknown (convert it with gdcmconv --raw)", h.meta.syntax_uid);
    h.answer.facts.data_offset = h.meta.data_offset;
    h.answer.facts.header_bytes = h.scan.header_end - (h.inflated.empty() ? h.meta.data_offset : 0);
    h.answer.facts.pixels = h.scan.pixels;
    return result == CTS_HEADER_DONE ? read_data_set(h, data) : result;
}

/* Writes the slices of a data set, or its elements as they are, into n bytes; the number of bytes needed. */
using Pack = size_t (*)(const Header &h, DcmDataset &data, uint8_t *bytes, size_t n);

void put_class_name(const Header &h, const char *class_uid)
{
    cts_reader_class_name(class_uid, h.answer.facts.class_name, sizeof h.answer.facts.class_name);
}

size_t pack_slices(const Header &h, DcmDataset &data, uint8_t *bytes, size_t n)
{
    struct Owned {
        CtsStringPool texts = {};
        CtsObject object = {};
        ~Owned()
        {
            cts_object_free(&object);
            cts_string_pool_free(&texts);
        }
    } owned;
    cts_dcm_read_object(data, &owned.texts, h.meta.sop_class_uid, &owned.object);
    if (!owned.object.n_slices || owned.object.kind == CTS_OBJECT_IMAGE)
        put_class_name(h, owned.object.class_uid);
    return cts_header_pack(&owned.object, &h.answer, bytes, n);
}

size_t pack_elements(const Header &h, DcmDataset &data, uint8_t *bytes, size_t n)
{
    OFString own_class;
    const bool has_class = data.findAndGetOFString(DCM_SOPClassUID, own_class).good() && !own_class.empty();
    put_class_name(h, has_class ? own_class.c_str() : h.meta.sop_class_uid);
    return h.answer.n = cts_elements_pack(data, h.meta.sop_class_uid, bytes, n);
}

/* The object, which is read as it is. */
size_t pack_written(const Header &h, DcmDataset &data, uint8_t *bytes, size_t n)
{
    return h.answer.n = cts_dcm_write(data, h.order, h.records, bytes, n);
}

/* One file's answer, at *used bytes of the message's. */
void answer_file(Header &h, Pack pack, uint8_t *out, size_t *used, size_t n_answer)
try {
    DcmDataset data;
    cts_dcm_memory_failed();
    CtsHeaderResult result = read_header(h, data);
    if (result == CTS_HEADER_DONE) {
        const size_t room = n_answer - *used, n = pack(h, data, out + *used, room);
        if (cts_dcm_memory_failed())
            throw std::bad_alloc();
        h.answer.at = *used;
        h.answer.need = n;
        result = n > room ? CTS_HEADER_ROOM : CTS_HEADER_DONE;
        *used += n > room ? 0 : std::min((n + 7) / 8 * 8, room);
    }
    h.answer.result = result;
} catch (const std::bad_alloc &) {
    h.answer.result = CTS_HEADER_MEMORY;
} catch (const std::runtime_error &why) {
    h.answer.result = refuse(h, "its patient and study cannot be copied: %s", why.what());
}

} // namespace

CtsStatus cts_reader_prepare(CtsError *err)
{
    dcmEnableAutomaticInputDataCorrection.set(OFFalse); /* values as they are, byte for byte */
    dcmEnableUnknownVRConversion.set(OFTrue);           /* an archive may have passed a known attribute on as UN */
    return cts_dcm_start(err);
}

CtsStatus cts_reader_answer(const void *order, const uint8_t *stream, size_t n, void *answer, size_t n_answer,
                            CtsError *err)
{
    static const Pack packs[CTS_N_READER_TASKS] = {pack_slices, pack_elements, pack_written};
    CtsReaderOrder o;
    std::memcpy(&o, order, sizeof o);
    auto *const items = reinterpret_cast<const CtsHeaderItem *>(stream);
    auto *const answers = static_cast<CtsHeaderAnswer *>(answer);
    size_t used = o.n_files * sizeof *answers;
    if (o.n_files * sizeof *items > n || used > n_answer)
        return cts_fail(err, CTS_ERR_INTERNAL, "a message of headers is too small");
    const CtsElements records = {stream + o.records_at, stream + o.records_at + o.n_records};
    for (uint64_t i = 0; i < o.n_files; i++) {
        answers[i] = CtsHeaderAnswer{};
        Header h{stream + items[i].at, items[i], o, records, answers[i], {}, {}, nullptr, nullptr, {}};
        answer_file(h, packs[o.task], static_cast<uint8_t *>(answer), &used, n_answer);
    }
    return CTS_OK;
}
