/* The patient and the study that an object joins: all attributes of these two levels (PS3.3 C.7.1.1, C.7.1.3, C.7.2.1
 * to C.7.2.3), as the source has them. */
#include <dcmtk/config/osconfig.h>

#include "output/objects/dcm_put.hpp"

#include <string>

namespace
{

/* When an attribute is there. */
enum Presence {
    ALWAYS, /* type 2: empty where the source has none */
    AS_IS,  /* type 3: as in the source, empty or not */
    FILLED  /* types 1 and 1C, and enumerated values: never empty */
};

const struct {
    DcmTagKey tag;
    Presence presence;
} attributes[] = {
    /* patient */
    {DCM_PatientName, ALWAYS},
    {DCM_PatientID, ALWAYS},
    {DCM_PatientBirthDate, ALWAYS},
    {DCM_PatientSex, ALWAYS},
    {DCM_SpecificCharacterSet, FILLED},
    {DCM_IssuerOfPatientID, AS_IS},
    {DCM_TypeOfPatientID, FILLED},
    {DCM_IssuerOfPatientIDQualifiersSequence, AS_IS},
    {DCM_SourcePatientGroupIdentificationSequence, AS_IS},
    {DCM_GroupOfPatientsIdentificationSequence, AS_IS},
    {DCM_SubjectRelativePositionInImage, AS_IS},
    {DCM_PatientBirthTime, AS_IS},
    {DCM_PatientBirthDateInAlternativeCalendar, AS_IS},
    {DCM_PatientDeathDateInAlternativeCalendar, AS_IS},
    {DCM_PatientAlternativeCalendar, FILLED},
    {DCM_QualityControlSubject, FILLED},
    {DCM_ReferencedPatientSequence, AS_IS},
    {DCM_ReferencedPatientPhotoSequence, AS_IS},
    {DCM_RETIRED_OtherPatientIDs, AS_IS},
    {DCM_OtherPatientIDsSequence, AS_IS},
    {DCM_OtherPatientNames, AS_IS},
    {DCM_EthnicGroup, AS_IS},
    {DCM_PatientComments, AS_IS},
    {DCM_PatientSpeciesDescription, FILLED},
    {DCM_PatientSpeciesCodeSequence, FILLED},
    {DCM_PatientBreedDescription, AS_IS},
    {DCM_PatientBreedCodeSequence, AS_IS},
    {DCM_BreedRegistrationSequence, AS_IS},
    {DCM_StrainDescription, AS_IS},
    {DCM_StrainNomenclature, AS_IS},
    {DCM_StrainStockSequence, AS_IS},
    {DCM_StrainAdditionalInformation, AS_IS},
    {DCM_StrainCodeSequence, AS_IS},
    {DCM_GeneticModificationsSequence, AS_IS},
    {DCM_ResponsiblePerson, AS_IS},
    {DCM_ResponsiblePersonRole, FILLED},
    {DCM_ResponsibleOrganization, AS_IS},
    {DCM_PatientIdentityRemoved, FILLED},
    {DCM_DeidentificationMethod, FILLED},
    {DCM_DeidentificationMethodCodeSequence, FILLED},
    {DCM_LongitudinalTemporalInformationModified, FILLED},
    /* clinical trial subject */
    {DCM_ClinicalTrialSponsorName, FILLED},
    {DCM_ClinicalTrialProtocolID, FILLED},
    {DCM_ClinicalTrialProtocolName, AS_IS},
    {DCM_ClinicalTrialSiteID, AS_IS},
    {DCM_ClinicalTrialSiteName, AS_IS},
    {DCM_ClinicalTrialSubjectID, FILLED},
    {DCM_ClinicalTrialSubjectReadingID, FILLED},
    {DCM_ClinicalTrialProtocolEthicsCommitteeName, FILLED},
    {DCM_ClinicalTrialProtocolEthicsCommitteeApprovalNumber, AS_IS},
    /* study */
    {DCM_StudyDate, ALWAYS},
    {DCM_StudyTime, ALWAYS},
    {DCM_ReferringPhysicianName, ALWAYS},
    {DCM_StudyID, ALWAYS},
    {DCM_AccessionNumber, ALWAYS},
    {DCM_ReferringPhysicianIdentificationSequence, AS_IS},
    {DCM_ConsultingPhysicianName, AS_IS},
    {DCM_ConsultingPhysicianIdentificationSequence, AS_IS},
    {DCM_IssuerOfAccessionNumberSequence, AS_IS},
    {DCM_StudyDescription, AS_IS},
    {DCM_PhysiciansOfRecord, AS_IS},
    {DCM_PhysiciansOfRecordIdentificationSequence, AS_IS},
    {DCM_NameOfPhysiciansReadingStudy, AS_IS},
    {DCM_PhysiciansReadingStudyIdentificationSequence, AS_IS},
    {DCM_RequestingService, AS_IS},
    {DCM_RequestingServiceCodeSequence, AS_IS},
    {DCM_ReferencedStudySequence, AS_IS},
    {DCM_ProcedureCodeSequence, AS_IS},
    {DCM_ReasonForPerformedProcedureCodeSequence, AS_IS},
    /* patient study */
    {DCM_AdmittingDiagnosesDescription, AS_IS},
    {DCM_AdmittingDiagnosesCodeSequence, AS_IS},
    {DCM_PatientAge, AS_IS},
    {DCM_PatientSize, AS_IS},
    {DCM_PatientWeight, AS_IS},
    {DCM_PatientBodyMassIndex, AS_IS},
    {DCM_MeasuredAPDimension, AS_IS},
    {DCM_MeasuredLateralDimension, AS_IS},
    {DCM_PatientSizeCodeSequence, AS_IS},
    {DCM_MedicalAlerts, AS_IS},
    {DCM_Allergies, AS_IS},
    {DCM_SmokingStatus, FILLED},
    {DCM_PregnancyStatus, FILLED},
    {DCM_LastMenstrualDate, AS_IS},
    {DCM_PatientState, AS_IS},
    {DCM_Occupation, AS_IS},
    {DCM_AdditionalPatientHistory, AS_IS},
    {DCM_AdmissionID, AS_IS},
    {DCM_IssuerOfAdmissionIDSequence, AS_IS},
    {DCM_ServiceEpisodeID, AS_IS},
    {DCM_IssuerOfServiceEpisodeIDSequence, AS_IS},
    {DCM_ServiceEpisodeDescription, AS_IS},
    {DCM_PatientSexNeutered, FILLED},
    {DCM_ReasonForVisit, AS_IS},
    {DCM_ReasonForVisitCodeSequence, AS_IS},
    /* clinical trial study */
    {DCM_ClinicalTrialTimePointID, AS_IS},
    {DCM_ClinicalTrialTimePointDescription, AS_IS},
    {DCM_LongitudinalTemporalOffsetFromEvent, FILLED},
    {DCM_LongitudinalTemporalEventType, FILLED},
    {DCM_ConsentForClinicalTrialUseSequence, AS_IS},
    /* younger than DCMTK's dictionary: how the patient is to be addressed, and who issued the trial's identifiers */
    {DcmTagKey(0x0010, 0x0011), AS_IS},
    {DcmTagKey(0x0010, 0x0014), AS_IS},
    {DcmTagKey(0x0010, 0x0041), AS_IS},
    {DcmTagKey(0x0010, 0x0043), AS_IS},
    {DcmTagKey(0x0012, 0x0022), AS_IS},
    {DcmTagKey(0x0012, 0x0023), AS_IS},
    {DcmTagKey(0x0012, 0x0032), AS_IS},
    {DcmTagKey(0x0012, 0x0041), AS_IS},
    {DcmTagKey(0x0012, 0x0043), AS_IS},
    {DcmTagKey(0x0012, 0x0054), AS_IS},
    {DcmTagKey(0x0012, 0x0055), AS_IS},
    {DcmTagKey(0x0012, 0x0086), AS_IS},
};

} // namespace

void cts_dcm_put_study(Put &put, DcmItem &source, const char *pseudonym)
{
    for (const auto &a : attributes)
        if (!pseudonym && (a.presence == FILLED ? source.tagExistsWithValue(a.tag) : source.tagExists(a.tag)))
            cts_dcm_copy(put, source, a.tag, a.presence == FILLED);
        else if (a.presence == ALWAYS)
            put.text(a.tag, "");
    if (!pseudonym)
        return;
    put.text(DCM_PatientName, (std::string("Anonymous^") + pseudonym).c_str()).text(DCM_PatientID, pseudonym);
    put.text(DCM_PatientIdentityRemoved, "YES").text(DCM_LongitudinalTemporalInformationModified, "REMOVED");
    put.text(DCM_DeidentificationMethod, "ctsplat: identity and dates removed, new UIDs, pixels unchanged");
    put.code(DCM_DeidentificationMethodCodeSequence, {"113100", "DCM", "Basic Application Confidentiality Profile"});
}
