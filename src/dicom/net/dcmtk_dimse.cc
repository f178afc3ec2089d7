/* DIMSE with DCMTK: C-STORE out, C-GET or C-MOVE in (PS3.4 B and C). */
#include "dicom/net/dcmtk_dimse.hpp"
#include "dicom/dcmtk/dcmtk_failures.hpp"
#include "dicom/net/peer.h"
#include "dicom/net/store_answer.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

namespace
{

/* Stores every incoming object under a name of ours. */
class GetScu : public CtsScu
{
  public:
    GetScu(const char *folder, CtsReception &reception_) : reception(reception_)
    {
        setStorageMode(DCMSCU_STORAGE_BIT_PRESERVING);
        setStorageDir(folder);
    }

  protected:
    /* Called repeatedly while a file is received. */
    void notifyRECEIVEProgress(const unsigned long n_bytes) override
    {
        reception.grows(n_bytes, *transport);
    }

    OFCondition handleSTORERequestFile(T_ASC_PresentationContextID *context, const OFString &,
                                       T_DIMSE_C_StoreRQ *request) override
    {
        char *const path = reception.begin();
        if (!path)
            return EC_IllegalCall;
        OFCondition state = DcmSCU::handleSTORERequestFile(context, path, request);
        if (state.good() && !reception.keep(path))
            state = EC_IllegalCall;
        free(path);
        return state;
    }

  private:
    CtsReception &reception;
};

bool is_native(const char *syntax_uid)
{
    return strcmp(syntax_uid, UID_LittleEndianExplicitTransferSyntax) == 0;
}

const char *remedy_of(const CtsOutgoingFile &outgoing)
{
    return is_native(outgoing.ids.syntax_uid) ? " (it must be set up to store this class)"
                                              : " (`compress` none sends it uncompressed)";
}

/* Stores one file over an open association. */
void store(DcmSCU &scu, const CtsNet &net, CtsOutgoingFile &outgoing, CtsAttempt &result)
{
    const T_ASC_PresentationContextID context =
        is_native(outgoing.ids.syntax_uid)
            ? scu.findAnyPresentationContextID(outgoing.ids.class_uid, outgoing.ids.syntax_uid)
            : scu.findPresentationContextID(outgoing.ids.class_uid, outgoing.ids.syntax_uid);
    if (context == 0) {
        cts_fail(&result.error, CTS_ERR_OUTPUT, "the peer does not take %s in %s%s",
                 cts_uid_words(outgoing.ids.class_uid).c_str(), cts_uid_words(outgoing.ids.syntax_uid).c_str(),
                 remedy_of(outgoing));
        return;
    }
    Uint16 status = 0;
    const OFCondition state = scu.sendSTORERequest(context, outgoing.path, nullptr, status);
    if (state.bad()) {
        result.again = true;
        cts_fail(&result.error, CTS_ERR_OUTPUT, "the connection broke: %s", cts_one_line(state).c_str());
    } else {
        const bool failed = status != STATUS_Success && (status & 0xF000) != 0xB000;
        cts_outgoing_file_answered(&outgoing, &net, failed, status, "refuses it with status", &result);
    }
}

void send_files(const CtsPeer &peer, const CtsNet &net, CtsOutgoingFile *outgoing_files, int n, CtsAttempt &result)
{
    CtsScu scu;
    for (int i = 0; i < n; i++) {
        OFList<OFString> syntaxes;
        syntaxes.push_back(outgoing_files[i].ids.syntax_uid);
        if (is_native(outgoing_files[i].ids.syntax_uid))
            syntaxes.push_back(UID_LittleEndianImplicitTransferSyntax);
        if (outgoing_files[i].sent)
            continue;
        scu.offer(outgoing_files[i].ids.class_uid, syntaxes);
        if (scu.remedy.empty())
            scu.remedy = remedy_of(outgoing_files[i]);
    }
    if (scu.associate(peer, net, CTS_ERR_OUTPUT, &result.again, &result.error))
        return;
    for (int i = 0; i < n && !result.error.status && !cts_net_stopped(&net); i++)
        if (!outgoing_files[i].sent)
            store(scu, net, outgoing_files[i], result);
    scu.hang_up(!result.again);
}

/* A fetch of a study, or of one of its series. */
struct Fetch {
    const CtsPeer &peer;
    const CtsNet &net;
    const CtsSeriesQuery &wanted;
    CtsFetchFolder &folder;
};

/* True for a modality of volumes, and where the peer does not say. */
bool may_be_volume(const CtsFoundSeries &series)
{
    bool may = !series.modality[0];
    for (const char *name : cts_modality_names)
        may |= !std::strcmp(series.modality, name);
    return may;
}

/* The study's CT, MR and PET series by C-FIND, or the requested one: a whole study contains objects that are not
 * needed, and some peers fail to send them. A peer without an answer may have the series nevertheless. */
std::vector<CtsFoundSeries> find_series(CtsScu &scu, const Fetch &f)
{
    CtsFound found = {};
    const char *const wanted = f.wanted.series_uid;
    cts_search_study(&f.wanted, &f.net, cts_dimse_search, &scu, &found, nullptr);
    std::vector<CtsFoundSeries> series;
    std::copy_if(found.items, found.items + found.n, std::back_inserter(series),
                 [&](const CtsFoundSeries &one) { return wanted || may_be_volume(one); });
    cts_found_free(&found);
    if (wanted && series.empty()) {
        series.emplace_back();
        std::snprintf(series[0].series_uid, sizeof series[0].series_uid, "%s", wanted);
    }
    return series;
}

/* Evaluates the last response. n_objects is raised to its total count. */
CtsStatus evaluate_responses(OFList<RetrieveResponse *> &responses, int *n_objects, CtsError *err)
{
    CtsStatus st = responses.empty() ? cts_fail(err, CTS_ERR_READ, "the peer does not answer") : CTS_OK;
    if (!responses.empty()) {
        const RetrieveResponse &last = *responses.back();
        const unsigned failed = last.m_numberOfFailedSubops;
        const bool counts = last.m_numberOfCompletedSubops + last.m_numberOfWarningSubops > 0;
        if (last.m_status != STATUS_Success && (last.m_status & 0xF000) != 0xB000)
            st = cts_fail(err, CTS_ERR_READ, "the peer refuses with status %04X%s", last.m_status,
                          cts_status_words(last.m_status));
        else if (failed > 0)
            st = cts_fail(err, CTS_ERR_READ, "the peer could not send %u of the series' objects", failed);
        else if (last.m_status != STATUS_Success && !counts)
            st = cts_fail(err, CTS_ERR_READ, "the peer ends with the warning %04X, and does not say what it sent",
                          static_cast<unsigned>(last.m_status));
    }
    for (OFListIterator(RetrieveResponse *) i = responses.begin(); i != responses.end(); ++i) {
        const RetrieveResponse &r = **i;
        *n_objects = std::max(*n_objects, r.m_numberOfRemainingSubops + r.m_numberOfCompletedSubops +
                                              r.m_numberOfFailedSubops + r.m_numberOfWarningSubops);
        delete *i;
    }
    return st;
}

/* Fetches one series after the other over an open association. In a whole study, a series that cannot be fetched is
 * reported and skipped. */
template <typename Send> CtsStatus each_series(CtsScu &scu, const Fetch &f, Send send, CtsError *err)
{
    for (const CtsFoundSeries &series : find_series(scu, f)) {
        const char *const uid = series.series_uid;
        const int n_before = f.folder.n_files;
        int n_objects = series.n_objects;
        DcmDataset query;
        OFList<RetrieveResponse *> responses;
        CtsError why = {};
        query.putAndInsertString(DCM_QueryRetrieveLevel, "SERIES");
        query.putAndInsertString(DCM_StudyInstanceUID, f.wanted.study_uid);
        query.putAndInsertString(DCM_SeriesInstanceUID, uid);
        const OFCondition state = cts_net_stopped(&f.net) ? OFCondition(EC_IllegalCall) : send(&query, &responses);
        CtsStatus st = evaluate_responses(responses, &n_objects, &why);
        if (cts_net_stopped(&f.net))
            return cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
        const int n_came = f.folder.n_files - n_before;
        if (!st && state.good() && n_came < n_objects)
            st = cts_fail(&why, CTS_ERR_READ, "%d of %d objects came, by the peer's own count", n_came, n_objects);
        if (state.bad())
            return cts_fail(err, CTS_ERR_READ, "the connection broke after %d files: %s", f.folder.n_files,
                            cts_one_line(state).c_str());
        if (st && f.wanted.series_uid)
            return *err = why, st;
        if (st) {
            cts_fetch_folder_limit(&f.folder, n_before);
            cts_report_diagnostic(f.net.report, CTS_DIAGNOSTIC_SERIES_NOT_FETCHED, "series %s is left out: %s", uid,
                                  why.text);
        } else {
            f.folder.n_promised += n_objects;
        }
    }
    return CTS_OK;
}

/* Offers to receive the SOP class in every transfer syntax. */
void offer_each(CtsScu &scu, const char *sop_class)
{
    for (const char *syntax : cts_ct_syntaxes) {
        OFList<OFString> one;
        one.push_back(syntax);
        scu.addPresentationContext(sop_class, one, ASC_SC_ROLE_SCP);
    }
}

/* Fetches with the retrieval that send() requests. */
template <typename Send> CtsStatus retrieve(CtsScu &scu, const char *model, const Fetch &f, Send send, CtsError *err)
{
    scu.offer(model);
    scu.remedy = f.net.move_port ? " (a peer that speaks DICOMweb is fetched from by its URL)"
                                 : " (`move-port` fetches by C-MOVE)";
    scu.offer(UID_FINDStudyRootQueryRetrieveInformationModel);
    CtsStatus st = scu.associate(f.peer, f.net, CTS_ERR_READ, nullptr, err);
    if (st)
        return st;
    const T_ASC_PresentationContextID context = scu.findPresentationContextID(model, "");
    if (context == 0)
        st = cts_fail(err, CTS_ERR_READ, "the peer does not know C-%s",
                      f.net.move_port ? "MOVE" : "GET (`move-port` fetches by C-MOVE)");
    else
        st = each_series(
            scu, f, [&](auto query, auto responses) { return send(context, query, responses); }, err);
    scu.hang_up(st == CTS_OK);
    return st;
}

CtsStatus get(const Fetch &f, CtsError *err)
{
    CtsReception reception(f.folder, f.net);
    GetScu scu(f.folder.folder, reception);
    for (const char *sop_class : cts_ct_classes)
        offer_each(scu, sop_class);
    for (const char *sop_class : cts_capture_classes)
        offer_each(scu, sop_class);
    const CtsStatus st = retrieve(
        scu, UID_GETStudyRootQueryRetrieveInformationModel, f,
        [&](auto context, auto query, auto responses) { return scu.sendCGETRequest(context, query, responses); }, err);
    const CtsStatus own = reception.failure(err); /* why we gave up ourselves */
    return own ? own : st;
}

CtsStatus move(const Fetch &f, CtsError *err)
{
    CtsScu scu;
    CtsReception reception(f.folder, f.net);
    CtsMoveListener listener(f.peer, f.net, reception);
    CtsStatus st = listener.open(err);
    if (!st)
        st = retrieve(
            scu, UID_MOVEStudyRootQueryRetrieveInformationModel, f,
            [&](auto context, auto query, auto responses) {
                return scu.sendMOVERequest(context, f.net.own_aet, query, responses);
            },
            err);
    listener.close();
    const CtsStatus taken = reception.failure(err);
    if (taken || listener.refused().empty() || (!st && f.folder.n_files))
        return taken ? taken : st;
    const std::string why = st ? err->text : "nothing came";
    return cts_fail(err, st ? st : CTS_ERR_READ, "%.200s; our listener refused its connection: %s", why.c_str(),
                    listener.refused().c_str());
}

} // namespace

extern "C" {

static void dimse_send(const CtsPeer *peer, const CtsNet *net, CtsOutgoingFile *outgoing_files, int n_outgoing,
                       CtsAttempt *result)
try {
    send_files(*peer, *net, outgoing_files, n_outgoing, *result);
} catch (...) {
    cts_dcm_caught(&result->error, CTS_ERR_OUTPUT);
}

static CtsStatus dimse_fetch(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *wanted,
                             CtsFetchFolder *folder, CtsError *err)
try {
    const Fetch f = {*peer, *net, *wanted, *folder};
    return net->move_port ? move(f, err) : get(f, err);
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_READ);
}

static CtsStatus dimse_find(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *query, CtsFound *found,
                            CtsError *err)
try {
    CtsScu scu;
    scu.offer(UID_FINDStudyRootQueryRetrieveInformationModel);
    CtsStatus st = scu.associate(*peer, *net, CTS_ERR_READ, nullptr, err);
    if (st)
        return st;
    st = cts_search_series(query, net, cts_dimse_search, &scu, found, err);
    scu.hang_up(st == CTS_OK);
    return st;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_READ);
}

const CtsProtocol cts_protocol_dimse = {dimse_send, dimse_fetch, dimse_find};
}
