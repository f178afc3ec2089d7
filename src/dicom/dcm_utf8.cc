/* Text of any DICOM character set, safe to show. */
#include <dcmtk/config/osconfig.h>

#include "dicom/dcm_door.hpp"
#include "dicom/dcm_read.h"

#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmdata/dcspchrs.h>
#include <string>

namespace
{

/* Bytes of the UTF-8 character at p and its code, 0 when it is none (PS3.5 has no use for overlong forms either). */
size_t utf8_length(const unsigned char *p, size_t n, unsigned *code)
{
    const size_t length = p[0] < 0x80                   ? 1
                          : p[0] >= 0xC2 && p[0] < 0xE0 ? 2
                          : p[0] >= 0xE0 && p[0] < 0xF0 ? 3
                          : p[0] >= 0xF0 && p[0] < 0xF5 ? 4
                                                        : 0;
    if (length == 0 || length > n)
        return 0;
    *code = length == 1 ? p[0] : p[0] & (0xFFu >> (length + 1));
    for (size_t i = 1; i < length; i++) {
        if ((p[i] & 0xC0) != 0x80)
            return 0;
        *code = *code << 6 | (p[i] & 0x3F);
    }
    const bool overlong = (length == 3 && *code < 0x800) || (length == 4 && *code < 0x10000);
    return overlong || *code > 0x10FFFF || (*code >= 0xD800 && *code < 0xE000) ? 0 : length;
}

/* Controls, and marks that turn the writing direction or break a line. */
bool unsafe(unsigned code)
{
    return code < 0x20 || (code >= 0x7F && code < 0xA0) || (code >= 0x200E && code <= 0x200F) ||
           (code >= 0x2028 && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
}

std::string safe_text(const std::string &text)
{
    enum { MAX_CHARACTERS = 64 };
    std::string out;
    const unsigned char *p = reinterpret_cast<const unsigned char *>(text.data());
    size_t n = text.size();
    for (int i = 0; i < MAX_CHARACTERS && n > 0; i++) {
        unsigned code = 0;
        const size_t length = utf8_length(p, n, &code), used = length ? length : 1;
        if (length && !unsafe(code))
            out.append(reinterpret_cast<const char *>(p), length);
        else
            out += '?';
        p += used;
        n -= used;
    }
    return out;
}

/* ASCII in a single-byte set or UTF-8 (ISO_IR 100 to 192), all of which hold ASCII unchanged: the usual case. */
bool is_same_in_utf8(const char *text, const char *charset)
{
    for (const char *c = text; *c; c++)
        if (static_cast<unsigned char>(*c) >= 0x80 || *c == 0x1B)
            return false;
    return std::strncmp(charset, "ISO_IR 1", 8) == 0 && std::strlen(charset) == 10;
}

std::string converted(const char *text, const char *charset)
{
    if (!charset || is_same_in_utf8(text, charset) || cts_dcm_start(nullptr))
        return text;
    const CtsDcmUse use(cts_dcm_in_use());
    OFString out;
    DcmSpecificCharacterSet converter;
    if (charset[0] && DcmSpecificCharacterSet::isConversionAvailable() &&
        converter.selectCharacterSet(charset).good() && converter.convertString(text, out).good())
        return std::string(out.c_str(), out.length());
    return text;
}

} // namespace

char *cts_dcm_utf8(const char *text, const char *charset)
try {
    const std::string out = safe_text(converted(text, charset));
    return strdup(out.c_str());
} catch (...) {
    return nullptr;
}
