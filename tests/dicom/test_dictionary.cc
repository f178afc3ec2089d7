/* The dictionary that ctsplat loads equals DCMTK's own for every tag. */
#include <dcmtk/config/osconfig.h>

#include "dicom/header/dcm_call.hpp"
#include "dicom/header/dcm_read.h"

#include <cstdio>
#include <cstring>
#include <dcmtk/dcmdata/dcdicent.h>
#include <dcmtk/dcmdata/dcdict.h>

namespace
{

long n_seen, n_wrong;

void compare(const DcmDataDictionary &ours, const DcmDictEntry &theirs, const DcmTagKey &tag)
{
    const DcmDictEntry *found = ours.findEntry(tag, nullptr);
    n_seen++;
    if (found && found->getEVR() == theirs.getEVR() && std::strcmp(found->getTagName(), theirs.getTagName()) == 0)
        return;
    if (n_wrong++ < 10)
        std::printf("(%04x,%04x): %s here, %s there\n", tag.getGroup(), tag.getElement(),
                    found ? found->getTagName() : "nothing", theirs.getTagName());
}

} // namespace

int main()
{
    CtsError err = {};
    DcmDataDictionary theirs(OFFalse, OFTrue);
    if (cts_dcm_start(&err)) {
        std::printf("%s\n", err.text);
        return 1;
    }
    const DcmDataDictionary &ours = dcmDataDict.rdlock();
    for (DcmHashDictIterator i = theirs.normalBegin(); i != theirs.normalEnd(); ++i)
        if (!(*i)->getPrivateCreator())
            compare(ours, **i, (*i)->getKey());
    for (DcmDictEntryListIterator i = theirs.repeatingBegin(); i != theirs.repeatingEnd(); ++i) {
        const DcmTagKey low = (*i)->getKey(), high = (*i)->getUpperKey();
        for (const unsigned group :
             {low.getGroup() + 0u, low.getGroup() + 1u, low.getGroup() + 2u, high.getGroup() + 0u})
            for (const unsigned element :
                 {low.getElement() + 0u, low.getElement() + 1u, low.getElement() + 2u, high.getElement() + 0u}) {
                const DcmTagKey tag(static_cast<Uint16>(group), static_cast<Uint16>(element));
                if (const DcmDictEntry *entry = theirs.findEntry(tag, nullptr))
                    compare(ours, *entry, tag);
                else
                    n_wrong += ours.findEntry(tag, nullptr) != nullptr;
            }
    }
    dcmDataDict.rdunlock();
    std::printf("%ld tags, %ld of them wrong\n", n_seen, n_wrong);
    return n_wrong || n_seen < 4000;
}
