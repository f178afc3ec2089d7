/* Text of any DICOM character set, safe to show. */
#include <dcmtk/config/osconfig.h>

#include "base/text.h"
#include "dicom/dcm_door.hpp"
#include "dicom/dcm_read.h"

#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmdata/dcspchrs.h>
#include <string>

namespace
{

std::string safe_text(const std::string &text)
{
    enum { MAX_CHARACTERS = 64 };
    std::string out;
    const char *p = text.data();
    size_t n = text.size();
    for (int i = 0; i < MAX_CHARACTERS && n > 0; i++) {
        bool safe = false;
        const size_t used = cts_text_step(p, n, &safe);
        out.append(safe ? p : "?", safe ? used : 1);
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
