/* The patient and the study that an object joins: all attributes of these two levels (PS3.3 C.7.1.1, C.7.1.3, C.7.2.1
 * to C.7.2.3), as the source has them. */
#include <dcmtk/config/osconfig.h>

#include "dicom/writer/dcmtk_write.hpp"

namespace
{

/* Type 2: empty where the source has none. */
const DcmTagKey always[] = {DCM_PatientName,    DCM_PatientID, DCM_PatientBirthDate,       DCM_PatientSex,
                            DCM_StudyDate,      DCM_StudyTime, DCM_ReferringPhysicianName, DCM_StudyID,
                            DCM_AccessionNumber};

/* Types 1 and 1C, and enumerated values: never empty. */
const DcmTagKey filled[] = {DCM_SpecificCharacterSet,
                            DCM_TypeOfPatientID,
                            DCM_PatientAlternativeCalendar,
                            DCM_QualityControlSubject,
                            DCM_PatientSpeciesDescription,
                            DCM_PatientSpeciesCodeSequence,
                            DCM_ResponsiblePersonRole,
                            DCM_PatientIdentityRemoved,
                            DCM_DeidentificationMethod,
                            DCM_DeidentificationMethodCodeSequence,
                            DCM_LongitudinalTemporalInformationModified,
                            DCM_ClinicalTrialSponsorName,
                            DCM_ClinicalTrialProtocolID,
                            DCM_ClinicalTrialSubjectID,
                            DCM_ClinicalTrialSubjectReadingID,
                            DCM_ClinicalTrialProtocolEthicsCommitteeName,
                            DCM_SmokingStatus,
                            DCM_PregnancyStatus,
                            DCM_PatientSexNeutered,
                            DCM_LongitudinalTemporalOffsetFromEvent,
                            DCM_LongitudinalTemporalEventType};

/* Type 3: as in the source, empty or not. The last ones are newer than DCMTK's dictionary: the patient's form of
 * address, and the issuers of the trial's identifiers. */
const DcmTagKey as_is[] = {DCM_IssuerOfPatientID,
                           DCM_IssuerOfPatientIDQualifiersSequence,
                           DCM_SourcePatientGroupIdentificationSequence,
                           DCM_GroupOfPatientsIdentificationSequence,
                           DCM_SubjectRelativePositionInImage,
                           DCM_PatientBirthTime,
                           DCM_PatientBirthDateInAlternativeCalendar,
                           DCM_PatientDeathDateInAlternativeCalendar,
                           DCM_ReferencedPatientSequence,
                           DCM_ReferencedPatientPhotoSequence,
                           DCM_RETIRED_OtherPatientIDs,
                           DCM_OtherPatientIDsSequence,
                           DCM_OtherPatientNames,
                           DCM_EthnicGroup,
                           DCM_PatientComments,
                           DCM_PatientBreedDescription,
                           DCM_PatientBreedCodeSequence,
                           DCM_BreedRegistrationSequence,
                           DCM_StrainDescription,
                           DCM_StrainNomenclature,
                           DCM_StrainStockSequence,
                           DCM_StrainAdditionalInformation,
                           DCM_StrainCodeSequence,
                           DCM_GeneticModificationsSequence,
                           DCM_ResponsiblePerson,
                           DCM_ResponsibleOrganization,
                           DCM_ClinicalTrialProtocolName,
                           DCM_ClinicalTrialSiteID,
                           DCM_ClinicalTrialSiteName,
                           DCM_ClinicalTrialProtocolEthicsCommitteeApprovalNumber,
                           DCM_ReferringPhysicianIdentificationSequence,
                           DCM_ConsultingPhysicianName,
                           DCM_ConsultingPhysicianIdentificationSequence,
                           DCM_IssuerOfAccessionNumberSequence,
                           DCM_StudyDescription,
                           DCM_PhysiciansOfRecord,
                           DCM_PhysiciansOfRecordIdentificationSequence,
                           DCM_NameOfPhysiciansReadingStudy,
                           DCM_PhysiciansReadingStudyIdentificationSequence,
                           DCM_RequestingService,
                           DCM_RequestingServiceCodeSequence,
                           DCM_ReferencedStudySequence,
                           DCM_ProcedureCodeSequence,
                           DCM_ReasonForPerformedProcedureCodeSequence,
                           DCM_AdmittingDiagnosesDescription,
                           DCM_AdmittingDiagnosesCodeSequence,
                           DCM_PatientAge,
                           DCM_PatientSize,
                           DCM_PatientWeight,
                           DCM_PatientBodyMassIndex,
                           DCM_MeasuredAPDimension,
                           DCM_MeasuredLateralDimension,
                           DCM_PatientSizeCodeSequence,
                           DCM_MedicalAlerts,
                           DCM_Allergies,
                           DCM_LastMenstrualDate,
                           DCM_PatientState,
                           DCM_Occupation,
                           DCM_AdditionalPatientHistory,
                           DCM_AdmissionID,
                           DCM_IssuerOfAdmissionIDSequence,
                           DCM_ServiceEpisodeID,
                           DCM_IssuerOfServiceEpisodeIDSequence,
                           DCM_ServiceEpisodeDescription,
                           DCM_ReasonForVisit,
                           DCM_ReasonForVisitCodeSequence,
                           DCM_ClinicalTrialTimePointID,
                           DCM_ClinicalTrialTimePointDescription,
                           DCM_ConsentForClinicalTrialUseSequence,
                           DcmTagKey(0x0010, 0x0011),
                           DcmTagKey(0x0010, 0x0014),
                           DcmTagKey(0x0010, 0x0041),
                           DcmTagKey(0x0010, 0x0043),
                           DcmTagKey(0x0012, 0x0022),
                           DcmTagKey(0x0012, 0x0023),
                           DcmTagKey(0x0012, 0x0032),
                           DcmTagKey(0x0012, 0x0041),
                           DcmTagKey(0x0012, 0x0043),
                           DcmTagKey(0x0012, 0x0054),
                           DcmTagKey(0x0012, 0x0055),
                           DcmTagKey(0x0012, 0x0086)};

} // namespace

void cts_dcm_copy_study(DcmItem &to, DcmItem &source, bool deidentified)
{
    for (const DcmTagKey &tag : always)
        if (deidentified || !source.tagExists(tag))
            cts_dcm_check(to.insertEmptyElement(DcmTag(tag)));
        else
            cts_dcm_copy(to, source, tag);
    for (const DcmTagKey &tag : filled)
        if (!deidentified && source.tagExistsWithValue(tag))
            cts_dcm_copy(to, source, tag, true);
    for (const DcmTagKey &tag : as_is)
        if (!deidentified)
            cts_dcm_copy(to, source, tag);
}
