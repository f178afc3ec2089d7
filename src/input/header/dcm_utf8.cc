/* Text of any DICOM character set, safe to show. */
#include "base/text.h"
#include "input/header/dcm_readers.h"

#include <cstdlib>
#include <cstring>
#include <memory>
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

} // namespace

char *cts_dcm_utf8(const char *text, const char *charset)
try {
    const bool foreign = charset && charset[0] && !is_same_in_utf8(text, charset);
    const CtsDcmReaders *dcm = nullptr;
    char *const converted = foreign && !cts_dcm_readers(&dcm, nullptr) ? dcm->convert(text, charset) : nullptr;
    const std::unique_ptr<char, void (*)(void *)> owner(converted, std::free);
    const std::string out = safe_text(converted ? converted : text);
    return strdup(out.c_str());
} catch (...) {
    return nullptr;
}
