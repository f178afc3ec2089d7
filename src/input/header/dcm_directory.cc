/* DICOMDIR records -> file names. */
#include <dcmtk/config/osconfig.h>

#include "input/header/dcm_door.hpp"
#include "input/header/dcm_read.h"

#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmdata/dctk.h>
#include <string>
#include <vector>

namespace
{

/* A file ID is untrusted: it must name something below the DICOMDIR's own folder. */
bool relative_path(const OFString &id, std::string *path)
{
    path->clear();
    size_t start = 0;
    for (;;) {
        size_t end = id.find('\\', start);
        const bool last = end == OFString_npos;
        std::string part(id.c_str() + start, (last ? id.length() : end) - start);
        while (!part.empty() && part.back() == ' ')
            part.pop_back();
        if (part.empty() || part == "." || part == ".." || part.find('/') != std::string::npos ||
            part.find('\0') != std::string::npos)
            return false;
        *path += path->empty() ? part : "/" + part;
        if (last)
            return true;
        start = end + 1;
    }
}

char **as_array(const std::vector<std::string> &files)
{
    char **array = static_cast<char **>(std::calloc(files.size() + 1, sizeof *array));
    if (!array)
        return nullptr;
    for (size_t i = 0; i < files.size(); i++)
        if (!(array[i] = strdup(files[i].c_str()))) {
            while (i-- > 0)
                std::free(array[i]);
            std::free(array);
            return nullptr;
        }
    return array;
}

} // namespace

CtsStatus cts_dcm_directory(const uint8_t *bytes, size_t n, const CtsSyntax *native, char ***files, size_t *n_files,
                            size_t *n_refused, CtsError *err)
try {
    *files = nullptr;
    *n_files = *n_refused = 0;
    const CtsStatus st = cts_dcm_start(err);
    if (st)
        return st;
    const CtsDcmUse use(cts_dcm_in_use());
    DcmDataset data_set;
    const OFCondition result = cts_dcm_parse(data_set, bytes, n, native);
    DcmSequenceOfItems *records = nullptr;
    if (result.bad() || data_set.findAndGetSequence(DCM_DirectoryRecordSequence, records).bad())
        return cts_fail(err, CTS_ERR_READ, "cannot be read as a DICOMDIR (name the folder instead)");
    std::vector<std::string> found;
    std::string path;
    for (DcmObject *item = records->nextInContainer(nullptr); item; item = records->nextInContainer(item)) {
        OFString id;
        DcmItem *record = dynamic_cast<DcmItem *>(item);
        if (!record || record->findAndGetOFStringArray(DCM_ReferencedFileID, id).bad() || id.empty())
            continue;
        if (relative_path(id, &path))
            found.push_back(path);
        else
            ++*n_refused;
    }
    if (!(*files = as_array(found)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    *n_files = found.size();
    return CTS_OK;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_READ);
}
