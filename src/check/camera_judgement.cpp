// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check/judgements.h"

#include <algorithm>
#include <cmath>

namespace view_servo::check
{
namespace
{
Finding judgeImages(const CameraObservations& camera)
{
  constexpr double SLOW = 5.0;     // [Hz]
  constexpr int SMALL_SIDE = 240;  // [px]
  const std::string name = "images";
  if (camera.images.count == 0)
  {
    return error(name, camera.pairing_fault.empty() ? silence(camera.images, "image") : camera.pairing_fault,
                 "start the camera, or say camera:= (and image_transport:=) as its topics are named");
  }
  if (!camera.image_fault.empty())
  {
    return error(name, camera.image_fault,
                 "set the camera's driver to mono8, bgr8 or another encoding of OpenCV, compressed to jpeg or png");
  }
  const std::string found = number(camera.images.rate, 1) + " Hz on '" + camera.images.topic + "', " +
                            std::to_string(camera.width) + " x " + std::to_string(camera.height) + ", " +
                            camera.encoding;
  if (camera.images.rate < SLOW)
  {
    return warning(name, found, "set the camera to 10 Hz or more: robots move by what it saw last");
  }
  if (camera.images.usual_gap > INPUT_TIMEOUT)
  {
    return warning(name, found + ", with pauses of " + shortTime(camera.images.usual_gap),
                   "a robot stands in pauses above " + shortTime(INPUT_TIMEOUT) +
                       ": look for a full network or processor, or try image_transport:=compressed");
  }
  if (std::min(camera.width, camera.height) < SMALL_SIDE)
  {
    return warning(name, found, "set the camera to 640 x 480 or more: so small a picture shows few corners");
  }
  return ok(name, found);
}

Finding judgeContent(const PictureMeasures& picture)
{
  constexpr double TOO_MUCH_WHITE = 0.25;  // part of the picture
  constexpr int FEW_CORNERS = 100;
  const std::string name = "picture";
  if (!picture.lack_of_light.empty())
  {
    return error(name, picture.lack_of_light, "take the lens cap off, set the exposure, or turn the light on");
  }
  const std::string found = std::to_string(picture.corners) + " corners, " + std::to_string(picture.segments) +
                            " segments, mean brightness " + number(picture.brightness, 0) + " of 255";
  if (picture.overexposed > TOO_MUCH_WHITE)
  {
    return warning(name, found + ", " + number(100.0 * picture.overexposed, 0) + " % of it white",
                   "shorten the exposure, or turn the camera away from windows and lamps");
  }
  if (picture.corners < FEW_CORNERS)
  {
    return warning(name, found, "let the camera see more texture; where there is none, lines alone have to do");
  }
  return ok(name, found);
}

Finding judgeSharpness(const PictureMeasures& picture)
{
  constexpr double BLURRED = 2.0;  // corners and edges are looked for at scales of about a pixel [px]
  const std::string name = "sharpness";
  if (std::isnan(picture.edge_width))
  {
    return warning(name, "the picture shows too few edges to tell", "let the camera see something with contrast");
  }
  const std::string found = "edges are " + number(picture.edge_width, 1) + " px wide";
  return picture.edge_width > BLURRED ? warning(name, found + ", " + number(BLURRED, 0) + " px and less is sharp",
                                                "focus and clean the lens; while the robot moves, shorten the exposure")
                                      : ok(name, found);
}

Finding judgePairing(const CameraObservations& camera)
{
  constexpr double FEW = 0.8;  // part of the images
  const std::string name = "camera_info";
  const std::string stamp_alike = "let the camera's driver stamp image and camera_info alike";
  if (!camera.pairing_fault.empty())
  {
    return error(name, camera.pairing_fault,
                 camera.infos.count == 0 ? "let the camera's driver publish it beside image_raw (camera_info_manager)"
                                         : stamp_alike);
  }
  const std::string found = "with the stamps of " + std::to_string(camera.pairs) + " of " +
                            std::to_string(camera.images.count) + " images, on '" + camera.infos.topic + "'";
  return camera.pairs < FEW * camera.images.count ? warning(name, found, stamp_alike + "; others are not used")
                                                  : ok(name, found);
}

Finding judgeCalibration(const CameraObservations& camera)
{
  const std::string name = "calibration";
  if (!camera.calibration_fault.empty())
  {
    return error(name, camera.calibration_fault, "calibrate the camera at this size (camera_calibration)");
  }
  if (!std::isfinite(camera.focal_length))
  {
    return warning(name, "not known: no image has come with its camera_info", "see to camera_info first");
  }
  const std::string& topic = camera.images.topic;
  const std::string transport = "/compressed";
  const bool is_compressed = topic.size() > transport.size() &&
                             topic.compare(topic.size() - transport.size(), transport.size(), transport) == 0;
  const std::string raw = topic.substr(0, topic.size() - (is_compressed ? transport.size() : 0));
  if (camera.has_distortion && raw.find("_rect", raw.rfind('/') + 1) != std::string::npos)
  {
    return error(name,
                 "'" + topic + "' seems to be rectified, but camera_info has distortion, which would be removed again",
                 "use the raw images, by image:=image_raw, or a camera_info with D of zeros and K of rectified images");
  }
  const double angle = 2.0 * std::atan(0.5 * camera.width / camera.focal_length) * 180.0 / M_PI;
  const std::string found = (camera.model.empty() ? "pinhole" : camera.model) + ", focal length " +
                            number(camera.focal_length, 0) + " px, " + number(angle, 0) + " degrees wide";
  constexpr double NARROW = 15.0;  // [degrees]
  constexpr double WIDE = 150.0;
  return angle < NARROW || angle > WIDE
             ? warning(name, found, "calibrate the camera anew, unless its lens is really like that")
             : ok(name, found);
}

Finding judgeStamps(const CameraObservations& camera)
{
  constexpr double OLD = 0.25;     // [s]
  constexpr double FUTURE = 0.02;  // more than clocks that are synchronised differ [s]
  const std::string name = "image stamps";
  const StreamObservations& images = camera.images;
  if (!images.stamp_fault.empty())
  {
    return error(name, images.stamp_fault, "let the camera's driver stamp each image with the time of its exposure");
  }
  if (!camera.age_fault.empty())
  {
    return error(
        name, camera.age_fault,
        "synchronise the clocks of this computer and the camera's (chrony), look at use_sim_time, or find out what "
        "delays the images");
  }
  if (images.age < -FUTURE)
  {
    return warning(name, "images are stamped " + shortTime(-images.age) + " in the future",
                   "synchronise the clocks of this computer and the camera's (chrony)");
  }
  const std::string found = "images come " + shortTime(images.age) + " after their stamps";
  return images.age > OLD
             ? warning(name, found, "the picture is that old when it is used: look for what delays it, or drive slowly")
             : ok(name, found);
}

}  // namespace

std::string silence(const StreamObservations& stream, const std::string& what)
{
  const std::string none = "no " + what + " has come on '" + stream.topic + "'";
  return none + (stream.publisher.empty() ? ": nobody publishes it" : ", though " + stream.publisher + " publishes it");
}

Findings judgePicture(const PictureMeasures& picture)
{
  Findings findings = { judgeContent(picture) };
  if (picture.lack_of_light.empty())
  {
    findings.push_back(judgeSharpness(picture));
  }
  return findings;
}

Findings judgeCamera(const CameraObservations& camera)
{
  Findings findings = { judgeImages(camera) };
  if (camera.images.count == 0)
  {
    return findings;
  }
  if (camera.picture)
  {
    append(findings, judgePicture(*camera.picture));
  }
  findings.push_back(judgePairing(camera));
  if (camera.pairing_fault.empty())
  {
    findings.push_back(judgeCalibration(camera));
  }
  findings.push_back(judgeStamps(camera));
  return findings;
}

}  // namespace view_servo::check
