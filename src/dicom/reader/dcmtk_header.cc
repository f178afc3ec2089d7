/* A file's first bytes -> framing, data set, slices. */
#include "dicom/parser/tag_scan.h"
#include "dicom/reader/dcmtk_attributes.hpp"
#include "dicom/reader/reader.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <new>

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
        facts.odd |= CTS_ODD_NO_PREAMBLE;
    h.syntax = cts_syntax_find(uid);
    if (!*uid) {
        facts.odd |= CTS_ODD_NO_SYNTAX;
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
    return cts_scan_data(bytes, n, n_all, start, h.native, CTS_MAX_HEADER_BYTES, &h.scan);
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
    for (size_t want = FIRST_INFLATE; want <= CTS_MAX_HEADER_BYTES; want *= 2) {
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
    return refuse(h, "more than 64 MiB precede the pixels");
}

CtsHeaderResult read_data_set(Header &h, CtsStringPool &texts, CtsObject &object)
{
    const bool deflated = h.syntax && h.syntax->deflated;
    const uint8_t *const start = deflated ? h.inflated.data() : h.bytes + h.meta.data_offset;
    const size_t n = h.scan.header_end - (deflated ? 0 : h.meta.data_offset);
    DcmDataset data;
    DcmInputBufferStream in;
    in.setBuffer(start, static_cast<offile_off_t>(n));
    in.setEos();
    data.transferInit();
    const OFCondition parsed = n ? data.read(in, DcmXfer(h.native->uid).getXfer(), EGL_noChange) : EC_Normal;
    data.transferEnd();
    if (parsed.bad())
        return refuse(h, "damaged: DCMTK cannot read its data set (%s)", parsed.text());
    cts_dcm_read_object(data, &texts, h.meta.sop_class_uid, &object);
    return CTS_HEADER_DONE;
}

void put_facts(Header &h)
{
    CtsHeaderFacts &facts = h.answer.facts;
    facts.data_offset = h.meta.data_offset;
    facts.has_pixels = h.scan.has_pixels;
    facts.pixel_words = h.scan.pixel_words;
    facts.encapsulated = h.scan.encapsulated;
    facts.pixel_offset = h.scan.pixel_offset;
    facts.pixel_bytes = h.scan.pixel_bytes;
    facts.float_pixels = h.scan.float_pixels;
}

CtsHeaderResult read_header(Header &h, CtsStringPool &texts, CtsObject &object)
{
    const CtsScanResult meta = cts_scan_meta(h.bytes, h.item.n, h.item.n_file, &h.meta);
    if (meta == CTS_SCAN_MORE)
        return ask_for(h, h.meta.need, "meta header");
    if (meta != CTS_SCAN_DONE)
        return refuse(h, "damaged or cut short: %s", h.meta.why);
    CtsHeaderResult result = find_syntax(h);
    if (result == CTS_HEADER_DONE)
        result = h.syntax && h.syntax->deflated ? scan_deflated(h) : scan_plain(h);
    /* Apparent damage is in fact an unknown encoding. */
    if (result == CTS_HEADER_BAD && !h.syntax && *h.meta.syntax_uid)
        return refuse(h, "transfer syntax %s is unknown (convert it with gdcmconv --raw)", h.meta.syntax_uid);
    put_facts(h);
    return result == CTS_HEADER_DONE ? read_data_set(h, texts, object) : result;
}

/* One file's answer, at *used bytes of the message's. */
void answer_file(const uint8_t *stream, const CtsHeaderItem &item, CtsHeaderAnswer &answer, uint8_t *out, size_t *used,
                 size_t n_answer)
{
    CtsStringPool texts = {};
    CtsObject object = {};
    answer = CtsHeaderAnswer{};
    try {
        Header h{stream + item.at, item, answer, {}, {}, nullptr, nullptr, {}};
        CtsHeaderResult result = read_header(h, texts, object);
        if (result == CTS_HEADER_DONE) {
            answer.at = *used;
            const size_t n = cts_header_pack(&object, &answer, out + *used, n_answer - *used);
            if (n > n_answer - *used) {
                answer.need = n;
                result = CTS_HEADER_ROOM;
            } else {
                *used += (n + 7) / 8 * 8 < n_answer - *used ? (n + 7) / 8 * 8 : n_answer - *used;
            }
        }
        answer.result = result;
    } catch (const std::bad_alloc &) {
        answer.result = CTS_HEADER_MEMORY;
    }
    cts_object_free(&object);
    cts_string_pool_free(&texts);
}

} // namespace

CtsStatus cts_reader_headers(const void *order, const uint8_t *stream, size_t n, void *answer, size_t n_answer,
                             CtsError *err)
{
    uint64_t n_files;
    std::memcpy(&n_files, order, sizeof n_files);
    auto *const items = reinterpret_cast<const CtsHeaderItem *>(stream);
    auto *const answers = static_cast<CtsHeaderAnswer *>(answer);
    size_t used = n_files * sizeof *answers;
    if (n_files * sizeof *items > n || used > n_answer)
        return cts_fail(err, CTS_ERR_INTERNAL, "a message of headers is too small");
    for (uint64_t i = 0; i < n_files; i++)
        answer_file(stream, items[i], answers[i], static_cast<uint8_t *>(answer), &used, n_answer);
    return CTS_OK;
}
