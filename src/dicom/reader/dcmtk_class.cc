/* Readable names of SOP classes: "MR Image". */
#include <dcmtk/config/osconfig.h>

#include "dicom/reader/reader.h"

#include <cctype>
#include <cstdio>
#include <cstring>
#include <dcmtk/dcmdata/dcuid.h>
#include <string>

/* True at the start of a word within DCMTK's "MRImageStorage": a capital after a small letter, or before one. */
static bool begins_word(const std::string &name, size_t i)
{
    const auto is_capital = [&](size_t k) { return std::isupper(static_cast<unsigned char>(name[k])) != 0; };
    return i > 0 && is_capital(i) && (!is_capital(i - 1) || (i + 1 < name.size() && !is_capital(i + 1)));
}

void cts_reader_class_name(const char *class_uid, char *text, size_t size)
{
    if (!class_uid[0]) {
        std::snprintf(text, size, "DICOM without SOP class");
        return;
    }
    const char *found = dcmFindNameOfUID(class_uid);
    if (!found) {
        /* A header must not drive a terminal. */
        const bool is_uid = std::strspn(class_uid, "0123456789.") == std::strlen(class_uid);
        std::snprintf(text, size, "of SOP class %.40s", is_uid ? class_uid : "that is no UID");
        return;
    }
    std::string name = found;
    const size_t storage = name.rfind("Storage");
    if (name == "MediaStorageDirectoryStorage")
        name = "DICOMDIR";
    else if (storage != std::string::npos && storage > 0)
        name.erase(storage);
    size_t n = 0;
    for (size_t i = 0; i < name.size() && n + 2 < size; i++) {
        if (name != "DICOMDIR" && begins_word(name, i))
            text[n++] = ' ';
        text[n++] = name[i];
    }
    text[n] = 0;
}
