#include "dicom/writer/dcmtk_write.hpp"

#include <cstring>
#include <string>

namespace
{

/* Body parts of PS3.16 Annex L that are paired, or parts of a limb. */
bool is_paired(const char *part)
{
    static const char parts[] =
        " ACJOINT ADRENAL ANKLE ARM AXILLA CALCANEUS CALF CAROTID CLAVICLE CLAVICLE_ACROMION EAR ELBOW EXTREMITY EYE "
        "EYELID FEMUR FINGER FOOT FOREARM FOREFOOT HAND HINDFOOT HIP HUMERUS IAC ILIUM INNEREAR IPJOINT KIDNEY KNEE "
        "LEG LOWERARM LOWERLEG LOWERLIMB LUNG MASTOID OPTICCANAL ORBIT OVARY PAROTID PATELLA RADIUS RADIUSULNA RIB "
        "SCAPULA SCJOINT SHOULDER SIJOINT SUBCLAVIAN TESTIS THIGH THUMB TIBFIB TIBIA TMJ TOE ULNA UPPERARM UPPERLIMB "
        "WRIST ZYGOMA ";
    const std::string word = std::string(" ") + part + " ";
    return *part && std::strstr(parts, word.c_str());
}

} // namespace

/* Laterality is required for paired parts, or empty where it is unknown (C.7.3.1.1.1); for all others ImageLaterality
 * is U. */
void cts_dcm_copy_side(DcmItem &to, DcmItem &source)
{
    const char *text = nullptr;
    const char *const part = source.findAndGetString(DCM_BodyPartExamined, text).good() && text ? text : "";
    bool has_side = false;
    for (const DcmTagKey &tag : {DCM_BodyPartExamined, DCM_Laterality, DCM_ImageLaterality}) {
        DcmElement *element = nullptr;
        if (has_side || source.findAndGetElement(tag, element).bad())
            continue;
        cts_dcm_copy(to, *element, true);
        has_side = tag != DCM_BodyPartExamined && to.tagExists(tag);
    }
    if (!has_side && is_paired(part))
        cts_dcm_check(to.insertEmptyElement(DcmTag(DCM_Laterality)));
    else if (!has_side) /* an axial slice contains both breasts */
        cts_dcm_check(to.putAndInsertString(DCM_ImageLaterality, std::strcmp(part, "BREAST") == 0 ? "B" : "U"));
}
