#!/usr/bin/env python3
"""The DICOM conformance statement, by the template of PS3.2, with tables made from the source:

    conformance.py SOURCE_ROOT VERSION roff|html COMPILER... >FILE

The C++ compiler finds DCMTK's lists of UIDs and attributes."""
import html
import pathlib
import re
import subprocess
import sys

root, version, form = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
dcmtk = subprocess.run([*sys.argv[4:], "-std=c++17", "-E", "-dD", "-include", "dcmtk/dcmdata/dcuid.h",
                        "-include", "dcmtk/dcmdata/dcdeftag.h", "-x", "c++", "/dev/null"],
                       check=True, stdout=subprocess.PIPE, text=True).stdout
uid_of = dict(re.findall(r'#define\s+UID_(\w+)\s+"([0-9.]+)"', dcmtk))


def source(name):
    return (root / "src" / name).read_text()


def listed(name, what):
    """The UIDs of one array of the source, as rows of keyword and UID."""
    found = re.search(re.escape(what) + r"\[\] = \{(.*?)\};", source(name), re.S)
    return [(k, uid_of[k]) for k in re.findall(r"UID_(\w+)", found.group(1))]


def written_classes(*names):
    """The UIDs of storage classes in files of the source."""
    uids = {uid for n in names for uid in re.findall(r'"(1\.2\.840\.10008\.5\.1\.4\.[0-9.]+)"', source(n))}
    return sorted((keyword_of[uid], uid) for uid in uids)


def attributes(*names):
    keys = [k for n in names for k in re.findall(r"DCM_(?:RETIRED_)?([A-Z]\w+)", source(n))]
    return sorted(set(keys))


def copied_attributes(name):
    """The attributes within the ranges of one file."""
    ranges = re.findall(r"\{0x([0-9A-F]{8}), 0x([0-9A-F]{8})\}", source(name))
    tags = re.findall(r"#define\s+DCM_(?:RETIRED_)?(\w+)\s+DcmTagKey\(0x(\w{4}), 0x(\w{4})\)", dcmtk)
    return sorted(key for key, group, element in tags
                  if any(first <= (group + element).upper() <= last for first, last in ranges))


codecs = {"NATIVE": "ctsplat", "RLE": "DCMTK", "JPEG": "DCMTK", "JPEG_LS": "DCMTK", "JPEG_2000": "OpenJPEG",
          "DEFLATE": "zlib", "COPY": "ctsplat", "NONE": "refused", "REMOTE": "refused"}
syntaxes = [(name, uid, codecs[codec]) for uid, name, codec in
            re.findall(r'\{"([0-9.]+)", "([^"]+)", CTS_CODEC_(\w+),', source("dicom/protocol/syntax.c"))]
written = [("ExplicitVRLittleEndian", "1.2.840.10008.1.2.1", "none")] + [
    (next(n for n, u, _ in syntaxes if u == uid), uid, name.lower().replace("_", "-"))
    for name, uid in re.findall(r'\[CTS_SC_(\w+)\] = \{"([0-9.]+)"', source("output/export/sc.c"))]
read_classes = re.findall(r'(\{|directory_class\[\] = )"([0-9.]+)"(?:, CTS_MODALITY|;)', source("dicom/reader/dcmtk_slice.cc"))
keyword_of = {uid: key for key, uid in reversed(list(uid_of.items()))}
label_uids = re.search(r"label_classes\[\] = \{(.*?)\};", source("dicom/reader/dcmtk_slice.cc"), re.S).group(1)
read_classes = [(keyword_of[uid], uid) for _, uid in read_classes] + [
    (keyword_of.get(uid, "LabelMapSegmentationStorage") + " (--labels)", uid)
    for uid in re.findall(r'"([0-9.]+)"', label_uids)]
models = [(k, uid_of[k]) for k in
          dict.fromkeys(re.findall(r"UID_((?:FIND|GET|MOVE)\w+)", source("dicom/net/dcmtk_dimse.cc")))]
storage = "dicom/net/dcmtk_dimse.hpp"
ct_classes, captures = listed(storage, "cts_ct_classes"), listed(storage, "cts_capture_classes")

both = "dicom/objects/records.c", "dicom/writer/dcmtk_write.cc"

P, H, S, T = "p", "h", "s", "t"
statement = [
    (H, "Conformance statement overview"),
    (P, "ctsplat reads CT images from files or from a PACS, renders them, and writes pictures as secondary captures and "
        "presentation states that join the study of their source, to files or to a PACS. It is a program for the "
        "command line; it keeps no database. Pictures are not for diagnostic use."),
    (T, ("Network service", "User (SCU)", "Provider (SCP)"),
     [("Storage of captures and states (C-STORE)", "yes: --send", "no"),
      ("Query of studies and series (C-FIND)", "yes: --from", "no"),
      ("Retrieve (C-GET)", "yes: --from", "no"),
      ("Retrieve (C-MOVE)", "yes: --from with --move-port", "storage of what was asked for alone"),
      ("DICOMweb QIDO-RS, WADO-RS, STOW-RS", "yes: a URL in --from, --send", "no"),
      ("DICOMweb rendered3D (Retrieve Rendered Volume), thumbnails, capabilities", "no", "ctsplat serve"),
      ("Storage commitment, worklist, MPPS, printing, media", "no", "no")]),
    (H, "Introduction"),
    (P, "For administrators of PACS and for integrators. Version " + version + ". Terms are those of the DICOM standard "
        "(PS3.1 to PS3.18); AE is application entity, SCU and SCP service class user and provider."),
    (H, "Networking"),
    (S, "Implementation model"),
    (P, "One AE, that of the command that runs: it fetches a series, renders it, writes files, and stores them. "
        "Nothing is done without a command. Studies that scanners send are received by Orthanc or DCMTK's storescp, which "
        "have conformance statements of their own; ctsplat batch renders the files that they store."),
    (S, "AE titles and ports"),
    (P, "The calling AE title is CTSPLAT unless --aet says otherwise; the called one stands in AET@HOST:PORT. C-MOVE "
        "receives at --move-port, from the addresses and the AE title of the peer that it asked, and takes nothing that calls another AE title."),
    (S, "Associations"),
    (P, "One at a time as SCU. As SCP, while C-MOVE runs, up to 16 at a time from the peer that was asked; one ends after "
        "--peer-timeout of silence, and when the fetch exceeds its limits or the disk is nearly full. Others are closed "
        "before they can ask for an association. Maximum PDU size 16384 bytes, DCMTK's default. "
        "No asynchronous operations. A peer that is down, refuses or breaks off is tried four times, after one, two "
        "and four seconds; a silent one is given up after --peer-timeout, 30 seconds."),
    (S, "SOP classes of storage, as SCU"),
    (T, ("SOP class", "UID"), written_classes("dicom/objects/capture_attributes.c", "dicom/objects/objects.h")),
    (P, "Offered in the transfer syntax that the file has, and uncompressed ones in Implicit VR Little Endian too."),
    (S, "SOP classes of query and retrieve, as SCU"),
    (T, ("SOP class", "UID"), models),
    (P, "C-FIND at level STUDY, with StudyInstanceUID, AccessionNumber, PatientID and StudyDate as keys that match or are "
        "returned, then at level SERIES for each study, with StudyInstanceUID as unique key and SeriesInstanceUID, "
        "Modality, SeriesDescription and NumberOfSeriesRelatedInstances; a fetch asks at level SERIES alone. Relational "
        "queries and extended negotiation are not asked for. Answers that contradict a key are left out; status FF01 and "
        "Warning 299 are reported."),
    (S, "SOP classes accepted while retrieving"),
    (T, ("SOP class", "UID"), ct_classes + captures),
    (T, ("Transfer syntax", "UID"), listed(storage, "cts_ct_syntaxes")),
    (P, "By C-GET, and by C-MOVE as SCP of storage while the fetch runs, with verification in Explicit and Implicit VR "
        "Little Endian (VerificationSOPClass, " + uid_of["VerificationSOPClass"] + "); the first of the transfer syntaxes "
        "above that a presentation context offers. Objects are kept as they come until the picture is made. Status A700: "
        "no room. No storage commitment."),
    (S, "DICOMweb"),
    (P, "QIDO-RS: GET of /studies with the same keys, and of /studies/UID/series with Modality, SeriesInstanceUID and "
        "includefield, as application/dicom+json. WADO-RS: GET of /studies/UID and /studies/UID/series/UID as "
        "multipart/related of application/dicom, any transfer syntax. STOW-RS: POST to /studies of the same type, one instance a request. User and password or "
        "a bearer token. A single object may come as application/dicom. Searches go on with offset. Redirections are followed "
        "within scheme, host and port; content encodings are decoded, and not asked for."),
    (S, "Rendered volumes (PS3.18 10.4.1.1.8)"),
    (P, "ctsplat serve answers GET of /studies/UID/rendered3D (where the study has one volume of CT), "
        "/studies/UID/series/UID/rendered3D and /studies/UID/series/UID/instances/UID/rendered3D (an object that holds its "
        "whole series, or a Volume Rendering Volumetric Presentation State that ctsplat wrote; others are 400). Media types: "
        "image/jpeg (the default), image/png with 8 bits, image/webp, application/dicom; a swivel is image/webp or "
        "application/dicom; application/dicom+json for renderedvolumetricmetadata. None that is accepted: 406. There is no "
        "renderedMPR: 404."),
    (T, ("Parameter", "Values", "What is done"),
     [("accept", "media types", "stands in for the Accept header"),
      ("renderingmethod", "volume_rendered, maximum_ip, minimum_ip, average_ip", "as the preset says where it is missing"),
      ("orientation", "a, p, r, l, h, f", "a where no camera is given"),
      ("viewpointposition, viewpointlookat", "three numbers each", "both or none; orthographic, so that the distance does not "
       "matter; the scale is as for the named views"),
      ("viewpointup", "three numbers", "only upright cameras: one that rolls is 400"),
      ("swivelrange", "degrees, at most 360", "to and fro from the first view on, range by step pictures each way: the standard counts one way, and a file that is shown over and over holds the way back too"),
      ("animationstepsize", "degrees", "a 36th of the range where it is missing"),
      ("animationrate", "pictures a second", "10 where it is missing"),
      ("window", "centre, width, linear or linear-exact", "of the methods but volume_rendered; sigmoid is 400"),
      ("viewport", "width, height", "1024,1024 where it is missing; a region is 400"),
      ("quality", "1 to 100", "of JPEG and WebP"),
      ("renderedvolumetricmetadata", "yes", "the Rendered Volume Response Module alone"),
      ("charset", "any", "answers are UTF-8"),
      ("volumeinputreference, match, volumetriccurvepoint, mprslab, annotation, iccprofile", "", "400, by name"),
      ("preset, view, size, max-error and others", "as options of ctsplat render", "extensions: ctsplat-serve(1)")]),
    (P, "Beside a presentation state only orientation, the viewpoint parameters, viewport, quality and accept are taken; others "
        "are 400. A parameter that is not known is 400 too, by name, where the standard lets it be ignored."),
    (P, "Thumbnails: GET of /studies/UID/thumbnail (its largest volume; else its first series), "
        "/studies/UID/series/UID/thumbnail and /studies/UID/series/UID/instances/UID/thumbnail. A series' is the volume as "
        "ctsplat renders it without options, or where it is none the middle image by its window; an instance's is its own "
        "image, of several frames the middle one. image/jpeg (the default), image/png or image/webp, else 406. Of the "
        "parameters accept, charset and viewport alone, whose two numbers are 256,256 where they are missing and 1024 at "
        "most; others are 400. A volume fills the viewport; an image keeps its proportions and is never enlarged. Images "
        "whose pixels may show the patient's name (as in a batch, see below), what is no image, and a series that is "
        "refused are 404, with the reason. Each has an ETag; If-None-Match is answered by 304."),
    (P, "Capabilities: OPTIONS of / is answered by a WADL document (PS3.18 Annex H), application/vnd.sun.wadl+xml alone, "
        "with a base that is relative to the request. With Access-Control-Request-Method it is a preflight of CORS."),
    (H, "Media and files"),
    (P, "Files of PS3.10 are read whatever their names, from folders, zip files and by a DICOMDIR, with and without "
        "preamble."),
    (S, "SOP classes read"),
    (T, ("SOP class", "UID"), read_classes),
    (P, "Images of any other class, except RT Dose, get thumbnails in a batch. Those of ultrasound, angiography, secondary "
        "captures, photographs and classes that are not known only where BurnedInAnnotation is NO, or with --show-patient."),
    (S, "Transfer syntaxes read"),
    (T, ("Transfer syntax", "UID", "decoded by"), syntaxes),
    (P, "Pixels of 8 or 16 bits allocated, one sample a pixel, in Hounsfield units."),
    (P, "RecommendedDisplayCIELabValue of a segment is read with the white point D65. PS3.3 C.10.7.1.1 has D50, but DCMTK, "
        "highdicom and dcmjs write D65, and viewers read it so: a blue of theirs would show as violet."),
    (S, "Series in doubt"),
    (P, "What is odd about a series has a code, in info --json and in the journal of a batch."),
    (T, ("Code", "When", "What is done"),
     [("missing_slices", "a gap is a multiple of the others, or SliceThickness is at most 0.6 of a gap over which "
       "InstanceNumber steps by n, a step is as long as SliceThickness or the smallest gap within 25 %, and the numbers "
       "between are not those of other objects of the study",
       "warning where a tenth or less is missing, or every 2nd or 3rd slice is there; else refused unless "
       "--allow-missing-slices is given"),
      ("orientation_jitter", "ImageOrientationPatient jitters, no voxel moves by more than a tenth of a pixel by the mean, "
       "and that does not drift", "note; the mean is taken. Else refused"),
      ("single_slices", "3 or more series of one study have a single slice each, of one size, orientation and pixel spacing, "
       "all of them or all of one SeriesNumber at even distances along their normal, at most a tenth of them missing",
       "note; none of them is a volume"),
      ("frames_of_reference", "each of 5 or more slices has a FrameOfReferenceUID of its own, all else is of one study and "
       "scanner, and they lie evenly", "warning; no presentation state is written, labels must name the slices; else "
       "refused"),
      ("concatenation_incomplete", "parts of a concatenation are missing by InConcatenationNumber, "
       "InConcatenationTotalNumber or ConcatenationFrameOffsetNumber", "warning; refused where frames between others are, "
       "as of missing slices"),
      ("no_suv", "a PET series lacks attributes of QIBA's vendor-neutral formula for SUVbw, or they differ from slice to slice",
       "warning; values are Bq/ml, or as stored in other units"),
      ("nifti_forms", "the sform and the qform of a NIfTI file differ: voxel size by more than 1 %, an axis by more than 1 "
       "degree, a corner by more than a voxel", "warning, the sform is taken; refused where one is mirrored or an axis "
       "differs by more than 45 degrees, unless --nifti-form decides"),
      ("constant_fill", "16 voxels in a row or column from each corner of a slice on have exactly one value above -700 HU, or "
       "4 such rows or columns from one corner on", "warning, they count as tissue; air with --fill"),
      ("outliers", "at most 1 of 10,000 voxels, in 26-connected parts of at most 8, lie below -32768 or above 65535 HU",
       "warning, low ones count as -1024 HU and high ones as the largest other value; more are refused"),
      ("table_removal_uncertain", "a table stands in air that is as dense as lungs and has no level of its own; or what "
       "goes or stays may be patient or table", "warning"),
      ("nifti_form_taken", "such a label map, one form of which equals the grid of the CT", "note, that form is taken"),
      ("labels_lacking", "in a batch: a series lacks some of the names of --show", "note, the others are shown")]),
    (S, "Transfer syntaxes written"),
    (T, ("Transfer syntax", "UID", "--compress"), written),
    (H, "Attributes"),
    (P, "By their keywords of PS3.6; values that the source lacks are left out where the standard allows it. The meta "
        "header has FileMetaInformationGroupLength, FileMetaInformationVersion, MediaStorageSOPClassUID, "
        "MediaStorageSOPInstanceUID, TransferSyntaxUID, ImplementationClassUID and ImplementationVersionName."),
    (S, "Copied from the source to each object, unless --deidentify is given"),
    (P, ", ".join(copied_attributes("dicom/writer/dcmtk_study.cc")) + "."),
    (S, "Written to secondary captures"),
    (P, "PixelData, " +
     ", ".join(attributes("dicom/objects/capture_attributes.c", "dicom/writer/dcmtk_side.cc", *both)) + "."),
    (S, "Written to presentation states"),
    (P, ", ".join(attributes("dicom/objects/state_attributes.c", *both))
     + ". Private attributes of group 0073, creator CTSPLAT STATE 1: (0073,xx01) the preset, (0073,xx02) the options."),
    (H, "Character sets"),
    (P, "SpecificCharacterSet and all texts of the source are copied byte for byte, in any character set; names of "
        "labels are decoded, those in ISO 2022 IR 87, 159, 149 and 58 too. What ctsplat "
        "writes itself is ASCII (ISO-IR 6)."),
    (H, "Security"),
    (P, "For ports, users, keys and records see ctsplat-security(7). Secure transport: TLS by the BCP 195 profile, with --tls-ca, --tls-key and --tls-cert. De-identification: the "
        "Basic Application Confidentiality Profile (PS3.15 E.2), with --deidentify; RecognizableVisualFeatures is YES "
        "whenever skin may be visible, by the preset, the window or the look of labels. No audit trail, no user identity negotiation, no digital signatures. "
        "Compressed pixels are decoded in processes without files and network."),
    (H, "Configuration"),
    (P, "Options of the command line; settings of the service in /etc/ctsplat/batch.conf, see ctsplat-batch(1)."),
]


def roff(text):
    return re.sub(r"^([.'])", r"\\&\1", text.replace("\\", "\\e").replace("-", "\\-"), flags=re.M)


def roff_table(heads, rows):
    def cell(text):
        return "T{\n" + roff(text) + "\nT}"
    lines = [".TS", "tab(|);", "l" + " lx" * (len(heads) - 1) + ".", "|".join(roff(h) for h in heads), "_"]
    return "\n".join(lines + ["|".join(cell(c) for c in row) for row in rows] + [".TE"])


def html_table(heads, rows):
    def line(tag, cells):
        return "<tr>" + "".join("<%s>%s</%s>" % (tag, html.escape(c), tag) for c in cells) + "</tr>"
    return "\n".join(["<table>", line("th", heads)] + [line("td", row) for row in rows] + ["</table>"])


if form == "roff":
    print("'\\\" t\n.TH CTSPLAT-CONFORMANCE 7 \"\" \"ctsplat %s\" \"Miscellaneous\"\n.SH NAME\n"
          "ctsplat\\-conformance \\- DICOM conformance statement\n.ad l" % version)
    for kind, *what in statement:
        print({P: lambda t: ".PP\n" + roff(t), H: lambda t: ".SH " + roff(t.upper()), S: lambda t: ".SS " + roff(t),
               T: roff_table}[kind](*what))
else:
    print("<!DOCTYPE html>\n<html lang=en><head><meta charset=utf-8><meta name=viewport content='width=device-width'>"
          "<title>ctsplat: DICOM conformance statement</title>\n<style>body{font:16px/1.5 sans-serif;max-width:50em;"
          "margin:2em auto;padding:0 1em;overflow-wrap:anywhere}table{border-collapse:collapse;margin:1em 0}td,th{"
          "border:1px solid #bbb;padding:.2em .6em;text-align:left;vertical-align:top}</style></head><body>\n"
          "<h1>ctsplat %s: DICOM conformance statement</h1>" % version)
    for kind, *what in statement:
        print({P: lambda t: "<p>%s</p>" % html.escape(t), H: lambda t: "<h2>%s</h2>" % html.escape(t),
               S: lambda t: "<h3>%s</h3>" % html.escape(t), T: html_table}[kind](*what))
    print("</body></html>")
