#include "output/net/scu.hpp"

#include <cstdio>
#include <vector>

namespace
{

void put(DcmDataset &query, const DcmTagKey &tag, const char *value)
{
    query.putAndInsertString(tag, value ? value : "");
}

template <size_t n> void take(DcmDataset &answer, const DcmTagKey &tag, char (&text)[n])
{
    OFString value;
    answer.findAndGetOFString(tag, value);
    std::snprintf(text, n, "%s", value.c_str());
}

void fill_study_query(DcmDataset &keys, const CtsSeriesQuery &q)
{
    put(keys, DCM_QueryRetrieveLevel, "STUDY");
    put(keys, DCM_StudyInstanceUID, q.study_uid);
    put(keys, DCM_AccessionNumber, q.accession);
    put(keys, DCM_PatientID, q.patient_id);
    put(keys, DCM_StudyDate, q.study_date);
}

void fill_series_query(DcmDataset &keys, const CtsSeriesQuery &q, const char *study_uid)
{
    put(keys, DCM_QueryRetrieveLevel, "SERIES");
    put(keys, DCM_StudyInstanceUID, study_uid);
    put(keys, DCM_SeriesInstanceUID, q.series_uid);
    put(keys, DCM_Modality, q.modality);
    put(keys, DCM_SeriesDescription, "");
    put(keys, DCM_NumberOfSeriesRelatedInstances, "");
}

CtsStatus find_series(CtsScu &scu, const CtsSeriesQuery &query, const CtsFoundSeries &study, CtsFound &found,
                      CtsError *err)
{
    DcmDataset keys;
    fill_series_query(keys, query, study.study_uid);
    CtsStatus st = scu.ask(keys, static_cast<size_t>(CTS_MOST_FOUND - found.n), err);
    for (size_t i = 0; i < scu.answers.size() && !st; i++) {
        CtsFoundSeries series = study;
        Sint32 n = 0;
        take(*scu.answers[i], DCM_SeriesInstanceUID, series.series_uid);
        take(*scu.answers[i], DCM_Modality, series.modality);
        take(*scu.answers[i], DCM_SeriesDescription, series.description);
        scu.answers[i]->findAndGetSint32(DCM_NumberOfSeriesRelatedInstances, n);
        series.n_objects = n;
        st = cts_found_add(&found, &series, err);
    }
    return st;
}

CtsStatus find_studies(CtsScu &scu, const CtsSeriesQuery &query, std::vector<CtsFoundSeries> &studies, CtsError *err)
{
    DcmDataset keys;
    fill_study_query(keys, query);
    const CtsStatus st = scu.ask(keys, CTS_MOST_FOUND, err);
    for (size_t i = 0; i < scu.answers.size() && !st; i++) {
        CtsFoundSeries study = {};
        take(*scu.answers[i], DCM_StudyInstanceUID, study.study_uid);
        take(*scu.answers[i], DCM_StudyDate, study.study_date);
        if (cts_uid_is_valid(study.study_uid))
            studies.push_back(study);
    }
    return st;
}

} // namespace

CtsStatus cts_dimse_find(const CtsPeer &peer, const CtsNet &net, const CtsSeriesQuery &query, CtsFound &found,
                         CtsError *err)
{
    std::vector<CtsFoundSeries> studies;
    CtsScu scu;
    scu.offer(UID_FINDStudyRootQueryRetrieveInformationModel);
    CtsStatus st = scu.associate(peer, net, CTS_ERR_READ, nullptr, err);
    if (st)
        return st;
    st = find_studies(scu, query, studies, err);
    for (size_t i = 0; i < studies.size() && !st && !cts_net_stopped(&net); i++)
        st = find_series(scu, query, studies[i], found, err);
    scu.hang_up(st == CTS_OK);
    return st;
}
