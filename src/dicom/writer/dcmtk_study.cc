/* The patient and the study that an object joins: all attributes of these two levels (PS3.3 C.7.1.1, C.7.1.3, C.7.2.1
 * to C.7.2.3), as the source has them. */
#include "dicom/writer/dcmtk_write.hpp"

#include <algorithm>

namespace
{

/* Type 2: empty where the source has none. */
const DcmTagKey always[] = {DCM_PatientName,    DCM_PatientID, DCM_PatientBirthDate,       DCM_PatientSex,
                            DCM_StudyDate,      DCM_StudyTime, DCM_ReferringPhysicianName, DCM_StudyID,
                            DCM_AccessionNumber};

/* The tags of the two levels, from the first to the last of each range: those of other levels lie between the ranges,
 * and newer attributes of these within them. Groups 0010 and 0012 are the patient's and the clinical trial's; 0028,0303
 * and 0012,0062 to 0012,0064 say what was removed of an identity; the others are the study's. */
const struct {
    Uint32 first, last;
} ranges[] = {{0x00080005, 0x00080005}, {0x00080020, 0x00080020}, {0x00080030, 0x00080030}, {0x00080050, 0x00080051},
              {0x00080090, 0x00080090}, {0x00080096, 0x0008009D}, {0x00081030, 0x00081032}, {0x00081048, 0x00081049},
              {0x00081060, 0x00081062}, {0x00081080, 0x00081084}, {0x00081110, 0x00081110}, {0x00081120, 0x00081120},
              {0x00100010, 0x00100043}, {0x00100200, 0x00100200}, {0x00100212, 0x00100221}, {0x00101000, 0x00101002},
              {0x00101010, 0x00101030}, {0x00101100, 0x00101100}, {0x00102000, 0x00102110}, {0x00102160, 0x001021D0},
              {0x00102201, 0x00102203}, {0x00102292, 0x00102299}, {0x00104000, 0x00104000}, {0x00120010, 0x00120055},
              {0x00120062, 0x00120064}, {0x00120081, 0x00120086}, {0x00280303, 0x00280303}, {0x00200010, 0x00200010},
              {0x00321033, 0x00321034}, {0x00321066, 0x00321067}, {0x00380010, 0x00380010}, {0x00380014, 0x00380014},
              {0x00380060, 0x00380060}, {0x00380062, 0x00380064}, {0x00380500, 0x00380500}, {0x00401012, 0x00401012}};

/* Types 1 and 1C, and enumerated values: never empty. Type 3 is as in the source, empty or not. */
const Uint32 filled[] = {0x00080005, 0x00100022, 0x00100035, 0x00100200, 0x001021A0, 0x001021C0, 0x00102201,
                         0x00102202, 0x00102203, 0x00102298, 0x00120010, 0x00120020, 0x00120040, 0x00120042,
                         0x00120052, 0x00120053, 0x00120062, 0x00120063, 0x00120064, 0x00120081, 0x00280303};

bool is_of_study(Uint32 number)
{
    return std::any_of(std::begin(ranges), std::end(ranges),
                       [=](const auto &range) { return range.first <= number && number <= range.last; });
}

} // namespace

void cts_dcm_copy_study(DcmItem &to, DcmItem &source, bool deidentified)
{
    for (const DcmTagKey &tag : always)
        cts_dcm_check(to.insertEmptyElement(DcmTag(tag)));
    for (DcmObject *o = source.nextInContainer(nullptr); o && !deidentified; o = source.nextInContainer(o)) {
        const Uint32 tag = static_cast<Uint32>(o->getGTag()) << 16 | o->getETag();
        if (is_of_study(tag))
            cts_dcm_copy(to, static_cast<DcmElement &>(*o), std::count(std::begin(filled), std::end(filled), tag));
    }
}
