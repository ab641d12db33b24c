/* What space.js alone has; the scripts ask `isSpatial` before they use it. */
declare const orbit: any;
